# SPDX-License-Identifier: Apache-2.0
"""openpi's own client, its images and its messages, and the package msgpack-numpy, in an environment of their own. Run by test_remote_policy.py.

    python openpi_client_check.py FOLDER PORT
"""

import sys
from pathlib import Path

import msgpack_numpy
import numpy as np
from openpi_client import image_tools
from openpi_client import msgpack_numpy as openpi_numpy
from openpi_client.websocket_client_policy import WebsocketClientPolicy
from websockets.sync.client import connect

folder, port = Path(sys.argv[1]), int(sys.argv[2])
for name, package in (("openpi", openpi_numpy), ("msgpack_numpy", msgpack_numpy)):
    (folder / f"{name}.theirs").write_bytes(package.packb(package.unpackb((folder / name).read_bytes())))
for path in sorted(folder.glob("image_*.npy")):
    np.save(folder / f"padded_{path.name}", image_tools.resize_with_pad(np.load(path), 224, 200))

joints = {"qpos/arm": np.arange(7, dtype=np.float32), "prompt": "Pick up the mug"}
client = WebsocketClientPolicy("127.0.0.1", port)
assert client.get_server_metadata()["mjsense"]["name"] == "joints"
answers = [client.infer(joints)["actions"] for _ in range(2)]
try:
    client.infer({"prompt": "Pick up the mug"})
except RuntimeError as error:
    assert "the observation has no 'qpos', which the policy needs" in str(error), error
else:
    raise AssertionError("a bad observation was answered")
with connect(f"ws://127.0.0.1:{port}", compression=None) as link:  # as the client of MolmoSpaces
    msgpack_numpy.unpackb(link.recv())
    link.send(msgpack_numpy.packb(joints))
    answers.append(msgpack_numpy.unpackb(link.recv())["actions"])
np.save(folder / "answers.npy", answers)
