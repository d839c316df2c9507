# SPDX-License-Identifier: Apache-2.0
"""Policies behind openpi's protocol, and our server of policies. MJSENSE_TEST_OPENPI=1 makes an environment with openpi's own client."""

import os
import pickle
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import tracemalloc
import urllib.request
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

msgpack = pytest.importorskip("msgpack")
pytest.importorskip("websockets")

from policy_servers import answer, chunk, packed, serving, stateless, unpacked
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import mjsense as mjs
from mjsense.evaluation import PolicyServer, RemotePolicy, evaluate
from mjsense.evaluation.policies import RandomPolicy
from mjsense.evaluation.remote import adapter, adapters, client, messages, server
from mjsense.evaluation.remote.served_adapter import ServedAdapter
from mjsense.exporting.mapping import Source

ROOT = Path(__file__).resolve().parents[2]
SMALL = {"cameras": [], "progress": False, "horizon": 7, "episodes": 4}
ADAPTER = """
[observation."observation/joint_position"]
streams = "qpos/arm"
[actions.gripper]
columns = [7]
[actions.arm]
columns = [0, 1, 2, 3, 4, 5, 6]
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "adapter.toml").write_text(ADAPTER)
    return str(tmp_path / "adapter.toml")


def same(*folders):
    first, *others = (mjs.Dataset(folder).episodes for folder in folders)
    assert len(first) == SMALL["episodes"]
    for other in others:
        for one, two in zip(first, other, strict=True):
            np.testing.assert_array_equal(one.states, two.states)


class Joints:
    """The rule of policy_servers.py."""

    name = "joints"
    observation = ("qpos",)

    def __init__(self, stateful=True):
        self.stateful, self.calls = stateful, {}

    def reset(self, world_ids):
        self.calls |= dict.fromkeys(world_ids.tolist(), 0)

    def act(self, observations):
        ids = observations["world_ids"].tolist()
        for world in ids:
            self.calls[world] += 1
        assert len(observations["instructions"]) == len(ids) and set(observations) == {"qpos", "world_ids", "instructions"}
        return np.stack([chunk(row, self.calls[world] if self.stateful else 1) for row, world in zip(observations["qpos"]["arm"], ids, strict=True)])


# Messages


VALUE = {
    "a": np.arange(6, dtype=">f4").reshape(2, 3), "b": np.zeros((0, 3), np.int16), "c": np.array(3.0), "d": np.float32(0.1), "e": [1, -2.5, "x", None, True, 2**64 - 1],
    "f": {"g": np.array([True, False]), "h": np.float16([np.nan, np.inf])}, "i": np.bool_(True), "j": np.full((4, 5, 3), 200, np.uint8)[:, ::2], "k": np.int64(-5),
}  # fmt: skip


def equal(one, other):
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            equal(one[key], other[key])
    elif isinstance(one, (np.ndarray, np.generic)):
        assert type(one) is type(other) and (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    else:
        assert one == other


@pytest.mark.parametrize("arrays", ["openpi", "msgpack_numpy"])
def test_messages_return_bit_for_bit(arrays):
    found = messages.unpack(messages.pack(VALUE, arrays))
    equal(found.value, VALUE)
    assert found.arrays == arrays
    with pytest.raises(ValueError, match="an array of type object cannot be sent"):
        messages.pack({"a": np.array([{}])}, arrays)
    with pytest.raises(TypeError, match="a set cannot be sent"):
        messages.pack({"a": {1}}, arrays)


def array_of(**keys):
    return msgpack.packb({b"__ndarray__": True, b"data": b"1234", b"dtype": "<f4", b"shape": [1], **{name.encode(): value for name, value in keys.items()}})


HOSTILE = {
    "a list of 4 billion": (b"\xdd\xff\xff\xff\xff", "exceeds max_array_len"), "a map of 4 billion": (b"\xdf\xff\xff\xff\xff", "exceeds max_map_len"),
    "bytes that are missing": (b"\xc6\xff\xff\xff\xff", "incomplete"), "deep": (b"\x91" * 500 + b"\x90", "deeper than 16"), "too deep to parse": (b"\x91" * 10**6, "StackError"),
    "deep and wide": (b"\xdc\x10\x00" * 1000, "incomplete"), "many": (b"\xdc\x10\x00" + (b"\xdc\x10\x00" + b"\xc0" * 4096) * 4096, "more than 65536 items"),
    "empty": (b"", "incomplete"), "more than one": (b"\x00\x00", "extra data"), "invalid": (b"\xc1", "FormatError"), "a key twice": (b"\x82\xa1a\x01\xa1a\x01", "same key twice"),
    "a time": (b"\xd7\xff" + b"0" * 8, "a Timestamp"), "an extension": (b"\xd4\x05x", "extension of type 5"), "no UTF-8": (b"\xa1\xff", "utf-8"), "a number as key": (b"\x81\x01\x01", "strict_map_key"),
    "bytes as key": (b"\x81\xc4\x01a\x01", "not a text"), "objects": (array_of(dtype="|O"), r"type '\|O'"), "records": (array_of(dtype=[["a", "<f4"]]), "must be a number"),
    "texts": (array_of(dtype="<U1"), "type '<U1'"), "complex": (array_of(dtype="<c8"), "type '<c8'"), "a type by name": (array_of(dtype="float32"), "type 'float32'"),
    "too few bytes": (array_of(shape=[2]), "4 bytes instead of 8"), "overflow": (array_of(shape=[2**62, 4]), r"has the shape \[46"), "negative": (array_of(shape=[-1, -1]), r"shape \[-1"),
    "many axes": (array_of(shape=[1] * 9), "at most 8 sizes"), "a size of half": (array_of(shape=[0.5]), "shape"), "a text as data": (array_of(data="1234"), "has a str"), "one more key": (array_of(x=1), "keys of openpi"),
    "a pickle": (msgpack.packb({b"nd": True, b"type": "O", b"kind": b"O", b"shape": [1], b"data": b"\x80\x04."}), "keys of msgpack-numpy"),
    "a number that does not fit": (msgpack.packb({b"__npgeneric__": True, b"data": 300, b"dtype": "|u1"}), "does not fit"),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_messages_are_refused_within_the_limits(case):
    data, message = HOSTILE[case]
    tracemalloc.start()
    with pytest.raises(ValueError, match=message):
        messages.unpack(data)
    assert tracemalloc.get_traced_memory()[1] < 64e6
    tracemalloc.stop()


# Adapters


SPECS = {
    "qpos/arm": ((7,), np.float32), "qpos/base": ((0,), np.float32), "qpos/gripper": ((2,), np.float32), "wrist_camera": ((36, 64, 3), np.uint8), "exo_camera_1": ((30, 20, 3), np.uint8),
    "wrist_camera_depth": ((36, 64), np.float32), "actions/joint_pos/arm": ((7,), np.float64), "actions/joint_pos/gripper": ((1,), np.float64),
}  # fmt: skip
RANGES = {"actions/joint_pos/arm": (-3, 3), "actions/joint_pos/gripper": (0, 255)}
STREAMS = {
    name: (name.split("/")[0], SimpleNamespace(name=name, unit="", shape=shape, dtype=dtype, is_dict=False, low=RANGES.get(name, (0, 0))[0], high=RANGES.get(name, (0, 0))[1]), None)
    for name, (shape, dtype) in SPECS.items()
}
GROUPS = {"gripper": slice(0, 1), "arm": slice(1, 8)}
LOW, HIGH = np.array([0.0] + [-3.0] * 7), np.array([255.0] + [3.0] * 7)


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)
    return {name: rng.integers(0, 255, (2, *shape)).astype(dtype) for name, (shape, dtype) in SPECS.items()}


def check(made, low=LOW, high=HIGH):
    made.check({name: spec for name, (_, spec, _) in STREAMS.items()}, GROUPS, low, high)
    return made


def test_the_adapter_of_droid(rows):
    made = check(adapters.adapter_of("droid", STREAMS, GROUPS))
    rows["qpos/gripper"][1] = [0.2, 9]
    message = made.message(rows, 1, "Pick up the mug")
    assert {key: getattr(value, "shape", value) for key, value in message.items()} == {
        "observation/exterior_image_1_left": (224, 224, 3), "observation/wrist_image_left": (224, 224, 3), "observation/joint_position": (7,), "observation/gripper_position": (1,),
        "prompt": "Pick up the mug",
    }  # fmt: skip
    assert message["observation/gripper_position"] == np.float32(0.25) and not message["observation/wrist_image_left"][:49].any()
    np.testing.assert_array_equal(message["observation/joint_position"], rows["qpos/arm"][1])
    commands = made.commands({"actions": np.array([[*range(7), 0.4], [*range(7), 0.6], [*range(7), np.nan]])}, GROUPS)
    np.testing.assert_array_equal(commands["gripper"], [[0], [255], [np.nan]])
    np.testing.assert_array_equal(commands["arm"], [np.arange(7)] * 3)
    assert adapters.DROID in (ROOT / "docs/evaluate.md").read_text()


def test_the_adapter_of_an_exports_features(rows):
    made = check(adapters.adapter_of("features", STREAMS, GROUPS))
    message = made.message(rows, 0, "Pick up the mug")
    assert set(message) == {"observation.state", "observation.images.wrist_camera", "observation.images.exo_camera_1", "prompt"}
    np.testing.assert_array_equal(message["observation.state"], [*rows["qpos/arm"][0], *rows["qpos/gripper"][0]])
    np.testing.assert_array_equal(message["observation.images.wrist_camera"], rows["wrist_camera"][0])
    commands = made.commands({"action": [*range(8)]}, GROUPS)  # arm, then gripper, as in an export
    np.testing.assert_array_equal(commands["arm"], [np.arange(7)])
    np.testing.assert_array_equal(commands["gripper"], [[7]])
    with pytest.raises(ValueError, match=r"'action' of shape \(1, 9\): must be \(H, 8\)"):
        made.commands({"action": [*range(9)]}, GROUPS)
    with pytest.raises(ValueError, match=r"'action' of shape \(300000, 8\): must have at most 1048576 numbers"):
        made.commands({"action": np.zeros((300_000, 8), np.uint8)}, GROUPS)
    for name in ("features", "droid"):  # of a controller that takes displacements
        with pytest.raises(ValueError, match="commands of the move group 'arm' are joint targets, and its controller takes other commands"):
            check(adapters.adapter_of(name, STREAMS, GROUPS), 2 * LOW, np.array([255.0] + [6.0] * 7))


def test_the_adapter_of_a_file(tmp_path, rows):
    (tmp_path / "a.toml").write_text(
        'prompt = ""\narrays = "msgpack_numpy"\n[observation.image]\nstreams = "wrist_camera"\nlayout = "chw"\n[observation.q]\nstreams = ["qpos/gripper", "qpos/arm"]\n'
        'columns = [8, 0]\nfrom = [0, 10]\nto = [1, -1]\ndtype = "float64"\n[actions.arm]\nkey = "arm"\n'
    )
    made = check(adapters.adapter_of(str(tmp_path / "a.toml"), STREAMS, GROUPS))
    rows["qpos/gripper"][0], rows["qpos/arm"][0, 6] = [2.5, 0], 100
    message = made.message(rows, 0, "Pick up the mug")
    np.testing.assert_array_equal(message["q"], [-1, 0.5])
    assert message["image"].shape == (3, 36, 64) and message["q"].dtype == np.float64 and made.arrays == "msgpack_numpy" and "prompt" not in message
    assert list(made.commands({"arm": np.zeros(7), "gripper": np.zeros(1)}, GROUPS)) == ["arm"]


def test_an_adapter_of_a_server_is_that_of_a_client_backwards(tmp_path, rows):
    (tmp_path / "a.toml").write_text(
        '[observation.image]\nstreams = "wrist_camera"\nlayout = "chw"\n[observation.q]\nstreams = ["qpos/gripper", "qpos/arm"]\n'
        "columns = [8, 7, 6, 5, 4, 3, 2, 1, 0]\nfrom = [0, 255]\nto = [1, -1]\n"
        '[actions.gripper]\ncolumns = [0]\nfrom = [0, 1]\nto = [255, 0]\n[actions.arm]\nkey = "arm"\n'
    )
    specs, commands = {name: spec for name, (_, spec, _) in STREAMS.items()}, np.random.default_rng(0).uniform(0, 3, (2, 8))
    for name, observed in ((str(tmp_path / "a.toml"), None), ("features", None), ("droid", ["qpos/arm"])):
        made = check(adapters.adapter_of(name, STREAMS, GROUPS))
        served = ServedAdapter(made, specs, GROUPS, observed)
        for stream, row in served.rows(made.message(rows, 1, "")).items():
            np.testing.assert_allclose(row, rows[stream][1], atol=1e-3)
        for group, found in made.commands(served.answer(commands), GROUPS).items():
            expected = commands[:, GROUPS[group]]
            np.testing.assert_allclose(found, np.where(expected > 127.5, 255, 0) if (name, group) == ("droid", "gripper") else expected, atol=1e-9)
    for observed, message in ((["qpos/gripper"], "'observation/gripper_position' does not have all numbers of qpos/gripper"), (["tcp_pos"], "it has no 'tcp_pos', which the policy observes")):
        with pytest.raises(ValueError, match=message):
            ServedAdapter(made, specs, GROUPS, observed)
    (tmp_path / "b.toml").write_text('[observation.q]\nstreams = "qpos/arm"\n[actions.arm]\n')
    with pytest.raises(ValueError, match="no key for the commands of the move group 'gripper'"):
        ServedAdapter(adapters.adapter_of(str(tmp_path / "b.toml"), STREAMS, GROUPS), specs, GROUPS, None)


@pytest.mark.parametrize("change, message", [
    (("streams =", "stream ="), "streams must be the name"), (('"qpos/arm"', '"qpos/amr"'), "no stream 'qpos/amr' for 'observation/joint_position'; did you mean 'qpos/arm'"),
    (("actions.arm", "actions.arms"), "no move group 'arms'; did you mean 'arm'"), (("[0, 1, 2, 3, 4, 5, 6]", "[0, 1]"), "2 columns for the move group 'arm', which takes 7"),
    (("[7]", '["7"]'), "columns is"), (("[7]", "[7]\nfrm = [0, 1]"), "actions.gripper: unknown key 'frm'; did you mean 'from'"), (("[7]", "[7]\nfrom = [0, 1]"), "from and to belong together"),
    (("[7]", "[7]\nfrom = [1, 1]\nto = [0, 1]"), "two different numbers"), (("[7]", "[7]\nfrom = [0, 1]\nto = [0, 256]"), "from 0 to 256; it takes 0 to 255"), (("[7]", "[7]\nthreshold = true"), "threshold is True"), (("[7]", "[7]\nwidth = 0"), "width is 0"),
    (('"qpos/arm"', '"qpos/arm"\nsize = "9x9"'), "not an image"), (('"qpos/arm"', '"wrist_camera"\nsize = "99999x9"'), "size is '99999x9'"), (('"qpos/arm"', '"wrist_camera"\nlayout = "cwh"'), "layout is 'cwh'"),
    (('"qpos/arm"', '["qpos/arm", "wrist_camera"]'), "contains 'wrist_camera' of shape"), (("[actions.", "[action."), "unknown key 'action'; did you mean 'actions'"), (('[observation."', 'arrays = "pickle"\n[observation."'), "arrays is 'pickle'"),
    (('"observation/joint_position"', '"prompt"'), "that of the instruction and of an observation"),
], ids=range(18))  # fmt: skip
def test_mistakes_in_an_adapter(file, change, message):
    text = ADAPTER.replace(*change)
    assert text != ADAPTER
    Path(file).write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)):
        check(adapters.adapter_of(file, STREAMS, GROUPS))


# Servers of others


def test_the_episodes_are_those_of_the_policy_itself(file, tmp_path):
    """Each world and episode has a connection of its own: the servers' policies count the calls in theirs."""
    evaluate("pick", policy=Joints, out=tmp_path / "direct", num_worlds=4, **SMALL)
    with serving(answer) as theirs, PolicyServer(Joints, port=0) as ours:
        for name, worlds, options in (
            ("a", 1, {"policy": theirs, "policy_options": {"adapter": file}}), ("b", 4, {"policy": theirs, "policy_options": {"adapter": file}}), ("c", 4, {"policy": ours.url}),
        ):  # fmt: skip
            evaluate("pick", out=tmp_path / name, num_worlds=worlds, **options, **SMALL)
    same(*(tmp_path / name for name in ("direct", "a", "b", "c")))


LAYOUT = [("arm", [-3.0] * 7, [3.0] * 7), ("gripper", [0.0], [255.0])]


def bound(url, file, **options):
    """A remote policy in two worlds that play the episodes 4 and 7."""
    return bind(RemotePolicy(url, adapter=file, **options))


def bind(made):
    streams = [("qpos", SimpleNamespace(name="qpos/arm", shape=(7,), dtype=np.float32, is_dict=False), np.zeros((2, 7), np.float32))]
    made._mjs_bind(SimpleNamespace(num_worlds=2), streams, LAYOUT)
    made._mjs_reset([0, 1], [4, 7], 0, ["Pick up the mug", "Lift the can"])
    made.wanted[:] = True
    return made


def test_a_killed_server_is_waited_for(file, capsys):
    """Two servers are killed before their second and fourth answer. Another one starts each time."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    done, codes = threading.Event(), []

    def restart():
        for die_after in (2, 4, 0):
            with subprocess.Popen([sys.executable, Path(__file__).parent / "policy_servers.py", str(port), str(die_after)], stdout=subprocess.PIPE) as process:
                while process.poll() is None and not done.wait(0.01):
                    pass
                process.kill()
            codes.append(process.returncode)

    thread = threading.Thread(target=restart)
    thread.start()
    try:
        made = bound(f"ws://127.0.0.1:{port}", file)
        for step in range(6):
            made._rows["qpos/arm"][:] = step
            np.testing.assert_array_equal(made.act({})["arm"], [chunk([step] * 7, 1)[:, :7]] * 2)
    finally:
        done.set()
        thread.join()
    assert codes == [9, 9, -signal.SIGKILL]
    assert re.search("policy 'remote', episode [47]: the connection was lost", capsys.readouterr().err)


def frame_of_10_gb(observation, state):
    state["link"].socket.sendall(b"\x82\x7f" + struct.pack(">Q", 10**10) + b"0" * 1000)
    time.sleep(5)


def fragments(observation, state):
    state["link"].send(b"0" * 30000 for _ in range(10**5))


BROKEN = {
    "slow": (lambda o, s: time.sleep(1), TimeoutError, "has not answered a message within 0.5 s, the option timeout"),
    "traceback": (lambda o, s: "Traceback (most recent call last):\n  File x\nKeyError: 'gone'\x1b[2J", RuntimeError, r"reports an error:\nTraceback.*\n.*\nKeyError: 'gone'\?\[2J$"),
    "wrong shape": (lambda o, s: {"actions": np.zeros((3, 5))}, ValueError, "has 5 columns, and the adapter takes column 7"), "lists": (lambda o, s: {"actions": [[1], [1, 2]]}, ValueError, "not an array of numbers"),
    "three axes": (lambda o, s: {"actions": np.zeros((1, 3, 8))}, ValueError, r"of shape \(1, 3, 8\): must be"), "no actions": (lambda o, s: {"action": np.zeros((1, 8))}, ValueError, "has no 'actions'; did you mean 'action'"),
    "a list": (lambda o, s: packed([1]), ValueError, "is a list instead of a map"), "text": (lambda o, s: {"actions": "now"}, ValueError, "not an array of numbers"), "no message": (lambda o, s: b"\xc1", ValueError, "not a valid message"),
    "frame of 10 GB": (frame_of_10_gb, ValueError, "more than 1000000 bytes, the limit"), "fragments": (fragments, ValueError, "more than 1000000 bytes, the limit"),
    "closing": (lambda o, s: None, ConnectionError, "closed the connection 3 times before it had answered"), "other lengths": (lambda o, s: {"actions": np.zeros((len(o["prompt"]), 8))}, ValueError, "has 12 actions, and 15 in policy 'remote', episode 4"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_server_is_one_error_that_names_the_episode(case, file, monkeypatch):
    monkeypatch.setattr(client, "MAX_BYTES", 10**6)
    rule, kind, message = BROKEN[case]

    def only_episode_7(observation, state):
        return {"actions": np.zeros((15, 8))} if observation["prompt"] == "Pick up the mug" else rule(observation, state)

    with serving(only_episode_7, close_timeout=0.1) as url:
        made = bound(url, file, timeout=0.5, patience=0.5)
        with pytest.raises(kind, match=rf"(?s)^policy 'remote', episode 7: .*{message}"):
            made.act({})
        made._connections.close()


def test_a_server_that_cannot_be_used(file, capsys):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"ws://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(ConnectionError, match=f"no policy server answers at {url}, which was tried for 0.2 s: .*Connect"):
        RemotePolicy(url, adapter=file, patience=0.2)
    assert f"Waiting for the policy server at {url}, for at most 0.2 s: " in capsys.readouterr().err
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(TimeoutError, match="has not accepted a connection within 0"):
        RemotePolicy(f"ws://127.0.0.1:{silent.getsockname()[1]}", adapter=file, timeout=0.1)
    with serving(answer) as url, pytest.raises(ValueError, match=r"not mjsense serve: name an adapter, droid, features or FILE.toml \(--adapter\)"):
        RemotePolicy(url)
    with serving(answer, greeting="the model is broken") as url, pytest.raises(RuntimeError, match="reports an error:\nthe model is broken"):
        RemotePolicy(url, adapter=file)
    with serving(answer, process_request=lambda link, request: link.respond(403, "")) as url, pytest.raises(ConnectionError, match="with the HTTP status 403"):
        RemotePolicy(url, adapter=file)

    def elsewhere(link, request):
        response = link.respond(302, "")
        response.headers["Location"] = "/elsewhere"
        return response

    with serving(answer, process_request=elsewhere) as url, pytest.raises(ConnectionError, match="with the HTTP status 302"):
        RemotePolicy(url, adapter=file)


def test_a_server_that_offers_another_policy_after_a_restart_is_refused():
    with PolicyServer(Joints, port=0) as first:
        made = bound(first.url, "")
        made.act({})
    with PolicyServer(Joints(False), port=first.port), pytest.raises(RuntimeError, match=r"episode 4: .* offers another policy than at the start"):
        made.act({})


@pytest.mark.parametrize("url", ["ws://", "ws://host:x", "ws://host:0", "ws://me:secret@host", "ws://ho st", "ws:host"])
def test_wrong_addresses(url):
    with pytest.raises(ValueError, match="expected ws://HOST:PORT") as raised:
        RemotePolicy(url, adapter="droid")
    assert "secret" not in str(raised.value)


def test_wrong_options():
    with pytest.raises(ValueError, match=r"'droidd' is neither a file .toml nor a name; did you mean 'droid'"):
        RemotePolicy("ws://localhost:1", adapter="droidd")
    with pytest.raises(ValueError, match="timeout is 0: must be a positive number"):
        RemotePolicy("ws://localhost:1", timeout=0)


def test_actions_that_are_not_finite_fail_their_episode_only(file, tmp_path):
    broken = threading.Semaphore(1)

    def sometimes(observation, state):
        found = answer(observation, state)
        if state["calls"] == 2 and broken.acquire(blocking=False):
            found["actions"][1, 0] = np.nan
        return found

    with serving(sometimes) as url:
        found = evaluate("pick", policy=url, policy_options={"adapter": file}, out=tmp_path / "out", num_worlds=2, **{**SMALL, "episodes": 2})
    assert sorted("not finite" in row["failure"] for row in found.to_table().to_pylist()) == [False, True]


def test_the_connections_of_a_policy_end_with_it(file):
    links, before, together = [], set(threading.enumerate()), threading.Barrier(2)

    def watched(observation, state):
        together.wait(5)  # the messages of both worlds are sent at once
        links.append(state["link"])
        return stateless(observation, state)

    with serving(watched) as url:
        made = bound(url, file)
        made.act({})
        assert len(links) == 2
        del made
        end = time.monotonic() + 5
        while any(link.protocol.state.name != "CLOSED" for link in links) and time.monotonic() < end:
            time.sleep(0.01)
        assert [link.protocol.state.name for link in links] == ["CLOSED"] * 2
    assert not [thread for thread in set(threading.enumerate()) - before if thread.name == "mjsense remote policy"]


def test_features_are_those_of_an_export(tmp_path):
    seen = {}

    def rule(observation, state):
        state.setdefault("rows", seen.setdefault(observation["prompt"], [])).append(observation)
        assert observation["observation.images.wrist_camera"].shape == (24, 32, 3)
        return {"action": [0.01 * len(state["rows"]), -0.7, 0, -2.3, 0, 1.6, 0, 40 + len(state["rows"])]}

    options = {**SMALL, "cameras": ["wrist_camera"], "width": 32, "height": 24, "episodes": 2}
    with serving(rule) as url:
        evaluate("pick", policy=url, policy_options={"adapter": "features"}, out=tmp_path / "out", num_worlds=2, **options)
    source = Source(tmp_path / "out")
    for episode in source.episodes:
        rows, messages = source.rows(episode), seen[episode.task]
        np.testing.assert_array_equal([message["observation.state"] for message in messages], rows["state"][:-1])
        steps = np.arange(1, len(messages) + 1)
        np.testing.assert_allclose(rows["action"][:, [0, 7]], np.stack([0.01 * steps, 40 + steps], 1))
    assert len(source.episodes) == len(seen) == 2


# Our server


QUESTION = {"qpos/arm": np.zeros(7, np.float32), "prompt": "Pick up the mug"}


def ask(url, message) -> Any:
    with connect(url, compression=None) as link:
        link.recv()
        link.send(message if isinstance(message, (bytes, str)) else packed(message))
        return link.recv()


@pytest.mark.parametrize("message, expected", [
    (b"\xc1", "not a valid message"), ("hello", "a message of text"), ([1], "a message is a list"), ({"prompt": "x"}, "no 'qpos', which the policy needs; it has none"),
    ({**QUESTION, "prompt": 3}, "'prompt' is a int"), ({**QUESTION, "qpos/arm/x": 1}, "has 'qpos/arm' and 'qpos/arm/x'"), ({**QUESTION, "qpos": {"arm": 1}}, "'qpos/arm' twice"), ({**QUESTION, "qpos/arm": "x"}, "must be an array of numbers"),
    ({**QUESTION, "mjsense/seed": -1}, "'mjsense/seed' is -1"), (array_of(dtype="|O"), "must be a number"), ({"qpos/hand": np.zeros(3)}, "Traceback"),
], ids=range(11))  # fmt: skip
def test_bad_requests_are_answered_by_text(message, expected):
    lines = []
    with PolicyServer(Joints, port=0, log=lines.append) as served:
        with connect(served.url, compression=None) as link:
            link.recv()
            link.send(message if isinstance(message, (bytes, str)) else packed(message))
            text = link.recv()
            assert isinstance(text, str) and expected in text and ("Traceback" in text) == (expected == "Traceback")
            with pytest.raises(ConnectionClosed, match="1011"):
                link.recv()
        np.testing.assert_array_equal(unpacked(ask(served.url, {**QUESTION, "other": np.zeros(2)}))["actions"], chunk(np.zeros(7), 1))
        nested = {"qpos": {"arm": np.zeros(7)}}
        np.testing.assert_array_equal(unpacked(ask(served.url, nested))["actions"], chunk(np.zeros(7), 1))
    assert len(lines) == 1 and lines[0].startswith("connection 0: ")


def test_limits_of_the_server(monkeypatch):
    monkeypatch.setattr(server, "MAX_BYTES", 10**5)
    with PolicyServer(Joints, port=0, connections=1) as served:
        assert urllib.request.urlopen(served.url.replace("ws", "http") + "/healthz").read() == b"OK\n"
        with pytest.raises(InvalidStatus, match="403"):
            connect(served.url, origin="http://evil.example")
        with connect(served.url) as link:
            link.recv()
            assert ask_metadata(served.url) == "all connections of this server are taken"
            with pytest.raises(ConnectionClosed, match="1009"):
                link.send(b"0" * 10**6)
                link.recv()
        time.sleep(0.1)
        made = RemotePolicy(served.url)
        answer = made._connections.ask({0: b"0" * 10**6})[0]
        assert isinstance(answer, ValueError) and "refuses the observation of 1000000 bytes" in str(answer)
        assert "fingerprint" in unpacked(ask_metadata(served.url))["mjsense"]
        with pytest.raises(ValueError, match=f"cannot listen at 127.0.0.1, port {served.port}: "):
            PolicyServer(Joints, port=served.port)


@pytest.mark.parametrize(("connections", "limit"), [(2, 64 << 20), (64, 8 << 20)])
def test_messages_of_all_connections_are_limited_together(connections, limit):
    with PolicyServer(Joints, port=0, connections=connections) as served:
        for size, code in ((limit, "1011"), (limit + 1, "1009")):  # not a message; too large
            with connect(served.url, compression=None) as link:
                link.recv()
                with pytest.raises(ConnectionClosed, match=code):
                    link.send(b"0" * size)
                    while True:
                        link.recv()


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """A certificate of 127.0.0.1 that signs itself, and its private key."""
    folder = tmp_path_factory.mktemp("certificate")
    made = [str(folder / "certificate.pem"), str(folder / "private.pem")]
    words = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj", "/CN=mjsense", "-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run(["openssl", "req", "-x509", *words, "-out", made[0], "-keyout", made[1]], check=True, capture_output=True)
    return made


def test_a_key_and_encryption(certificate, tmp_path):
    right, wrong = tmp_path / "right", tmp_path / "wrong"
    right.write_text("0123456789abcdef\n")
    wrong.write_text("0123456789abcdeg")
    access = {"key_file": str(right), "certificate": certificate[0]}
    with PolicyServer(Joints(), port=0, private_key=certificate[1], **access) as server:
        assert server.url.startswith("wss://127.0.0.1:")
        made = RemotePolicy(server.url, **access)
        assert made.name == "joints" and "0123456789abcdef" not in made.fingerprint()
        for options, message in (
            ({**access, "key_file": ""}, "needs a key: the option key_file"),
            ({**access, "key_file": str(wrong)}, "needs another key: the option key_file"),
            ({**access, "certificate": ""}, "its certificate is not trusted: self.signed certificate; the option certificate names"),
        ):
            with pytest.raises(ConnectionError, match=message):
                RemotePolicy(server.url, patience=0.1, **options)
    wrong.write_text("short")
    for options, message in (
        ({"key_file": str(wrong)}, "key_file '.*wrong': it must contain one key: 16 to 512 visible ASCII characters"),
        ({"certificate": certificate[0]}, "wss:// needs both certificate and private_key; private_key is missing"),
        ({"certificate": str(wrong), "private_key": str(wrong)}, "expected PEM files"),
    ):
        with pytest.raises(ValueError, match=message):
            PolicyServer(Joints(), port=0, **options)
    with pytest.raises(ValueError, match="a certificate belongs to wss://HOST:PORT"):
        RemotePolicy("ws://127.0.0.1:1", certificate=certificate[0])


def ask_metadata(url):
    with connect(url) as link:
        return link.recv()


def test_which_policies_can_be_served():
    for policy, options, message in (
        ("planner", {}, "policy 'planner' is computed together with its episode"), ("random", {}, r"knows the robot: name a task.*\(--task, --robot\)"), (Joints, {"task_options": {"robot": "franka"}}, "robot belongs to a task"),
        (Joints, {"host": ""}, "host is empty"), (Joints, {"port": 70000}, "port is 70000"), (Joints, {"connections": 0}, "connections is 0"), (Joints, {"host": "no.such.host.invalid"}, "cannot listen at no.such"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            PolicyServer(policy, **{"port": 0, **options})


class Peeking(mjs.Policy):
    observation = ("qpos",)

    def act(self, obs):
        return {"arm": np.zeros((self.num_worlds, 7)) + self.sim.time, "gripper": np.zeros((self.num_worlds, 1))}


class Grouped(mjs.Policy):
    observation = ("qpos",)

    def act(self, obs):
        gripper, arm = obs["qpos"]["gripper"][:, None, 1:], obs["qpos"]["arm"][:, None]
        return {"gripper": np.repeat(gripper, 2, 1), "arm": np.repeat(arm, 2, 1), "done": self.wanted & (arm[:, 0, 0] > 1)}


def test_policies_of_mjsense_are_served(tmp_path):
    question = {"qpos/arm": np.arange(7) / 10, "qpos/gripper": [0, 0.5]}
    with PolicyServer("random", task="pick", port=0) as served:  # its numbers depend on the episode
        local, remote = RandomPolicy(), pickle.loads(pickle.dumps(RemotePolicy(served.url)))
        local._mjs_bind(SimpleNamespace(num_worlds=2), [], served._served._env._rollout.action_layout())
        local._mjs_reset([0, 1], [4, 7], 0, ["", ""])
        local.wanted[:] = True
        bind(remote)
        for _ in range(2):
            expected, found = local.act({}), remote.act({})
            np.testing.assert_array_equal(np.concatenate([found["arm"][:, 0], found["gripper"][:, 0]], -1), expected)
    with PolicyServer(Grouped, task="pick", adapter="features", task_options={"cameras": []}, port=0) as served:
        assert {"adapter": "features"}.items() <= RemotePolicy(served.url)._server.items()
        found = messages.unpack(ask(served.url, {"observation.state": np.arange(9) / 10})).value["action"]
        np.testing.assert_allclose(found, [[*np.arange(7) / 10, 0.8]] * 2, atol=1e-6)
        assert "'observation.state' is int64 (8,): must be (9,)" in ask(served.url, {"observation.state": np.arange(8)})
        assert "the observation has no 'observation.state'" in ask(served.url, question)
    with PolicyServer(Peeking, task="pick", port=0) as served:
        assert "reads sim.time, and a served policy has observations only" in ask(served.url, question)
    with PolicyServer(Grouped, task="pick", task_options={"width": 32, "height": 24}, port=0) as served:
        assert unpacked(ask_metadata(served.url))["mjsense"]["observation"] == ["qpos/arm", "qpos/gripper"]
        np.testing.assert_array_equal(unpacked(ask(served.url, question))["actions"], [[*(np.arange(7) / 10).astype(np.float32), 0.5]] * 2)
        assert "returned 'done', and openpi's protocol has actions only" in ask(served.url, {**question, "qpos/arm": np.full(7, 2.0)})
        assert ask(served.url, {**question, "qpos/arm": np.zeros(3)}) == "'qpos/arm' is float64 (3,): must be float32 (7,)"
        assert "no 'qpos/gripper', which the policy needs" in ask(served.url, {"qpos/arm": np.zeros(7)})
    with PolicyServer(lambda obs: np.concatenate([obs["q"], obs["q"]], -1), port=0) as served:
        np.testing.assert_array_equal(unpacked(ask(served.url, {"q": np.arange(3)}))["actions"], [[0, 1, 2, 0, 1, 2]])


def test_the_program(tmp_path):
    (tmp_path / "nets.py").write_text("import numpy as np\nclass Net:\n    def __init__(self, n): self.n = n\n    def act(self, obs): return np.full((1, self.n), obs['x'][0])\n")
    command = [sys.executable, "-m", "mjsense", "serve", f"{tmp_path}/nets.py:Net", "--policy-option", "n=3", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            url = re.fullmatch(r"Policy 'net' is served at (ws://127.0.0.1:\d+). Ctrl-C ends it.\n", process.stdout.readline())[1]
            np.testing.assert_array_equal(unpacked(ask(url, {"x": 2.5}))["actions"], [[2.5] * 3])
            assert "Traceback" in ask(url, {"y": 1})
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(10) == 130 and process.stderr.read() == "connection 0: KeyError: 'x'\nmjsense: interrupted\n"


# openpi's client


def openpi():
    """The Python of the environment build/openpi; the test is skipped if it is not there and not wanted, or cannot be made."""
    folder = ROOT / "build/openpi"
    if not (folder / "complete").exists():
        if os.environ.get("MJSENSE_TEST_OPENPI", "0") == "0":
            pytest.skip(f"needs {folder}; make it: MJSENSE_TEST_OPENPI=1 ./dev test -k test_remote_policy")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        # openpi-client states that it needs NumPy 1, and works with 2.
        for words in (["numpy", "msgpack", "msgpack-numpy", "websockets", "pillow", "typing_extensions"], ["--no-deps", "openpi-client==0.1.2"]):
            pip = [folder / "bin/python", "-I", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries=1", *words]
            done = subprocess.run(pip, capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"pip cannot install {' '.join(words)}: {done.stderr.strip()[-300:]}")
        (folder / "complete").touch()
    return folder / "bin/python"


def test_openpis_client_and_messages(tmp_path):
    python = openpi()
    value = {key: item for key, item in VALUE.items() if key != "d"}  # a float32 returns as a number of openpi's
    for name in ("openpi", "msgpack_numpy"):
        (tmp_path / name).write_bytes(messages.pack(value, name))
    images = {"wide": (36, 64, 3), "high": (301, 77, 3), "large": (368, 640, 3), "exact": (224, 200, 3)}
    for name, shape in images.items():
        np.save(tmp_path / f"image_{name}.npy", np.random.default_rng(0).integers(0, 256, shape, np.uint8))
    with PolicyServer(Joints, port=0) as served:
        done = subprocess.run([python, "-I", Path(__file__).parent / "openpi_client_check.py", tmp_path, str(served.port)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    for name in ("openpi", "msgpack_numpy"):
        assert (tmp_path / f"{name}.theirs").read_bytes() == (tmp_path / name).read_bytes()
    for name in images:
        np.testing.assert_array_equal(adapter.resized(np.load(tmp_path / f"image_{name}.npy"), 200, 224), np.load(tmp_path / f"padded_image_{name}.npy"))
    # The second message of a connection is the second of its episode.
    np.testing.assert_array_equal(np.load(tmp_path / "answers.npy"), [chunk(np.arange(7), calls) for calls in (1, 2, 1)])
