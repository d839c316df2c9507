# SPDX-License-Identifier: Apache-2.0
"""``mjsense render``"""

from __future__ import annotations

import argparse
from typing import Any

from mjsense.commands._ray import add_ray, ray_options
from mjsense.commands.parser import Parser, add_episodes, episodes_of, field_values
from mjsense.core.counted import counted

EXAMPLES = [
    (
        'mjsense render data top --add-camera top="pos=0.5,0,1.6 lookat=0.5,0,0"',
        "Add a camera above the table; render the recorded ones again, too.",
    ),
    (
        'mjsense render data hand --cameras --add-camera hand="body=robot_0/gripper/base pos=0.17,0,-0.02 '
        'lookat=0,0,0.2 fovy=70"',
        "Only a new camera, mounted on the gripper.",
    ),
    (
        "mjsense render data large --width 1280 --depth --segmentation",
        "The recorded cameras with larger images, depth and segmentation.",
    ),
    ("mjsense render data droid --camera-system droid", "The cameras of another camera system of the robot."),
    ("mjsense render data more --cameras --sensors sensors.toml", "Add sensors, without images."),
]
_VECTORS = ("pos", "lookat", "quat", "up")


def _camera(text: str) -> tuple[str, dict[str, Any]]:
    """``NAME=KEY=VALUE ...`` as a name and a camera of :func:`mjsense.render`."""
    name, _, given = text.partition("=")
    camera: dict[str, Any] = {}
    for part in given.replace(";", " ").split():
        key, _, value = part.partition("=")
        if not value and key not in ("depth", "segmentation"):
            raise argparse.ArgumentTypeError(f"'{part}' has no value; expected KEY=VALUE")
        try:
            if key in _VECTORS:
                camera[key] = [float(number) for number in value.split(",")]
            elif key in ("width", "height"):
                camera[key] = int(value)
            elif key in ("depth", "segmentation"):
                camera[key] = value in ("", "true", "1")
            else:
                camera[key] = float(value) if key == "fovy" else value
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"'{part}': {error}") from error
    if not name or not camera:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form NAME=\"pos=X,Y,Z lookat=X,Y,Z\"")
    return name, camera


def add_arguments(parser: Parser) -> None:
    flag = argparse.BooleanOptionalAction
    parser.add_argument("path", help="A recording.")
    parser.add_argument("out", help="Output directory.")
    parser.add_argument(
        "--cameras", nargs="*", metavar="NAME", help="Recorded cameras to render; without a name none. By default all."
    )
    parser.add_argument(
        "--add-camera",
        type=_camera,
        action="append",
        default=[],
        metavar="NAME=...",
        help='A new camera: "pos=X,Y,Z lookat=X,Y,Z" or "pos=X,Y,Z quat=W,X,Y,Z", in metres; further keys are body, up, fovy, '
        "width, height, depth and segmentation. Can be repeated.",
    )
    parser.add_argument(
        "--camera-system",
        default="",
        metavar="NAME",
        help="Name or file of a camera system of the robot, instead of the recorded cameras.",
    )
    parser.add_argument("--sensors", metavar="FILE", help="TOML file with [[sensors]] tables, as in a robot.toml.")
    parser.add_argument("--copy", action=flag, default=True, help="Copy the videos of recorded cameras that do not change.")
    add_episodes(parser, "Positions of episodes in the recording, such as 3 17 or 0-9,12; by default all.")
    parser.add_fields("RenderCfg")
    add_ray(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.dataset import render
    from mjsense.dataset.sensor_tables import sensors_of

    added: dict[str, Any] = {}
    for name, camera in arguments.add_camera:
        if name in added:
            raise ValueError(f"--add-camera: '{name}' is given twice")
        added[name] = camera
    names = ("cameras", "camera_system", "copy")
    options: dict[str, Any] = {name: getattr(arguments, name) for name in names}
    options |= field_values(arguments, "RenderCfg") | {"add_cameras": added, "episodes": episodes_of(arguments)}
    if arguments.ray:
        return _on_ray(arguments, options)
    made = render(
        arguments.path,
        arguments.out,
        progress=False if arguments.quiet else None,
        sensors=(lambda: sensors_of(arguments.sensors)) if arguments.sensors else (),
        **options,
    )
    if not arguments.quiet:
        print(
            f"{counted(made.finished, 'episode')} with {counted(made.frames, 'image')} in {made.seconds:.1f} s: "
            f"{', '.join(map(str, made.paths))}"
        )
    return 0


def _on_ray(arguments: argparse.Namespace, options: dict[str, Any]) -> int:
    from functools import partial

    from mjsense.cluster import render_on_ray
    from mjsense.dataset.sensor_tables import sensors_of

    options.pop("batches", None)
    options["threads"] = options.get("threads") or 1
    if arguments.sensors:
        options["sensors"] = partial(sensors_of, arguments.sensors)
    made = render_on_ray(arguments.path, arguments.out, **options, **ray_options(arguments))
    if not arguments.quiet:
        print(f"{counted(made.kept, 'episode')} in {made.seconds:.1f} s: {made.out}")
    return 0
