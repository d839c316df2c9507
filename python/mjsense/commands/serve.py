# SPDX-License-Identifier: Apache-2.0
"""``mjsense serve``"""

from __future__ import annotations

import argparse

from mjsense.commands._policy import add_policy_options, policy_options
from mjsense.commands.fields import read_size
from mjsense.commands.parser import Parser, complete
from mjsense.commands.table import FIELDS, NAMES

EXAMPLES = [
    ("mjsense serve net.py:Network", "Offer a policy on this computer, at ws://127.0.0.1:8000."),
    ("mjsense serve net.py:Network --host 0.0.0.0 --port 9000", "Offer it on the network."),
    ("mjsense evaluate pick --policy ws://127.0.0.1:8000 --episodes 100 --out results", "Evaluate it from another terminal."),
]


def add_arguments(parser: Parser) -> None:
    parser.add_argument(
        "policy", help="The policy: python:MODULE:CLASS, FILE.py:CLASS, or another one that needs observations alone."
    )
    add_policy_options(parser)
    action = parser.add_argument(
        "--task",
        default="",
        metavar="TEXT",
        help="Task whose streams and robot the policy knows. Only a mjsense.Policy and --adapter need it.",
    )
    complete(action, NAMES["tasks"])
    complete(
        parser.add_argument("--robot", metavar="TEXT", help="Name or .toml of the robot; by default the task's."), NAMES["robots"]
    )
    parser.add_argument("--camera-system", metavar="TEXT", help="Camera system of the task, as in mjsense record.")
    parser.add_argument("--size", metavar="WxH", help="Width and height of the images.")
    parser.add_argument("--arm-controller", metavar="TEXT", help="Controller of the robot's arms, as in mjsense record.")
    action = parser.add_argument(
        "--adapter",
        default="",
        metavar="TEXT",
        help="Names and conventions of the clients' messages: droid, features, or a TOML file. By default the streams' own.",
    )
    complete(action, ("droid", "features"))
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="TEXT",
        help="Address to listen at; by default 127.0.0.1, this computer only. With 0.0.0.0, every program on the "
        "network can use the policy.",
    )
    parser.add_argument("--port", type=int, default=8000, help="Port; by default 8000; 0: any free one.")
    parser.add_argument("--connections", type=int, default=64, metavar="N", help="Maximum number of connections; by default 64.")
    parser.add_argument("--key-file", default="", metavar="FILE", help="File with a key that clients must have; by default none.")
    for name, what in (("certificate", "certificate"), ("private-key", "private key")):
        parser.add_argument(
            f"--{name}",
            default="",
            metavar="FILE",
            help=f"PEM file with the {what} of wss://; by default there is no encryption.",
        )
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    import threading

    from mjsense.commands.output import tell
    from mjsense.evaluation import PolicyServer

    names = ("robot", "camera_system", "arm_controller")
    task = {name: getattr(arguments, name) for name in names if getattr(arguments, name) is not None}
    if arguments.size is not None:
        task |= read_size(FIELDS["ImageCfg"], arguments.size)
    place = {
        name: getattr(arguments, name)
        for name in ("task", "adapter", "host", "port", "connections", "key_file", "certificate", "private_key")
    }
    with PolicyServer(
        arguments.policy, task_options=task, policy_options=policy_options(arguments.policy_options), log=tell, **place
    ) as server:
        if not arguments.quiet:
            print(f"Policy '{server.name}' is served at {server.url}. Ctrl-C ends it.", flush=True)
        threading.Event().wait()
    return 0
