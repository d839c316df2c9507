# SPDX-License-Identifier: Apache-2.0
"""A policy server that is written with websockets and msgpack alone, by the rules of openpi's: nothing of mjsense.

    python policy_servers.py PORT DIE_AFTER    # exits as if it was killed, instead of giving answer DIE_AFTER
"""

import contextlib
import os
import sys
import threading

import msgpack
import numpy as np
from websockets.sync.server import serve


def packed(value):
    def plain(array):
        return {b"__ndarray__": True, b"data": array.tobytes(), b"dtype": array.dtype.str, b"shape": array.shape}

    return msgpack.packb(value, default=plain)


def unpacked(data):
    def array(table):
        return np.frombuffer(table[b"data"], table[b"dtype"]).reshape(table[b"shape"]) if b"__ndarray__" in table else table

    return msgpack.unpackb(data, object_hook=array)


def chunk(joints, calls):
    """What the policies of these tests do: three actions that depend on the joints and on the number of calls in the episode."""
    actions = np.zeros((3, 8))
    actions[:, 1:7] = [0, 0, -1.5, 0, 1.5, 0]
    actions[:, 0] = 0.01 * calls + 0.001 * np.arange(3) + 0.01 * np.float64(joints[3])
    return actions


def answer(observation, state):
    """The number of calls is the state of a connection."""
    assert set(observation) == {"observation/joint_position", "prompt"} and observation["prompt"]
    state["calls"] = state.get("calls", 0) + 1
    return {"actions": chunk(observation["observation/joint_position"], state["calls"]), "policy_timing": {"infer_ms": 1.5}}


def stateless(observation, state):
    return {"actions": chunk(observation["observation/joint_position"], 1)}


@contextlib.contextmanager
def serving(rule, port=0, greeting=b"\x80", **options):
    """A server in a thread. ``rule(observation, state)`` returns a map, or what is sent: bytes or a text."""

    def handle(link):
        link.send(greeting)
        state = {"link": link}
        for data in link:
            given = rule(unpacked(data), state)
            if given is None:
                return
            link.send(given if isinstance(given, (bytes, str)) else packed(given))
            if isinstance(given, str):
                return

    with serve(handle, "127.0.0.1", port, compression=None, max_size=None, **options) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()
            thread.join()


if __name__ == "__main__":
    answers = 0

    def mortal(observation, state):
        global answers
        answers += 1
        if answers == int(sys.argv[2]):
            os._exit(9)
        return stateless(observation, state)

    with serving(mortal, int(sys.argv[1])):
        print("ready", flush=True)
        threading.Event().wait()
