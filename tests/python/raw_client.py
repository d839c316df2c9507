# SPDX-License-Identifier: Apache-2.0
"""A client of the viewer without a browser, which can send anything."""

import http.client
import socket
import struct
import time
from urllib.parse import urlsplit


class RawClient:
    """A websocket to a viewer's page.

    Args:
        url: Address of the page, as the program prints it.
        origin: Header Origin; by default that of the page. None: no header.
        host: Header Host; by default the address's.
        token: In place of the address's path.
    """

    def __init__(self, url, *, origin="", host=None, token=None, subprotocol=None):
        import msgspec
        import viser
        import zstandard
        from websockets.sync.client import connect

        self._codec, self._zstd = msgspec.msgpack, zstandard.ZstdDecompressor()
        parts = urlsplit(url)
        host = parts.netloc if host is None else host
        path = parts.path if token is None else f"/{token}"
        self._socket = connect(f"ws://{host}{path}", sock=socket.create_connection((parts.hostname, parts.port), 10), max_size=None, compression=None,
                               origin=f"http://{host}" if origin == "" else origin, subprotocols=[subprotocol or f"viser-v{viser.__version__}"],
                               open_timeout=10, close_timeout=1, max_queue=None)  # fmt: skip
        self.messages = []

    def read(self, seconds=0.5):
        """Receives until nothing has come for some time."""
        while True:
            try:
                raw = self._socket.recv(timeout=seconds)
            except TimeoutError:
                return self
            size, packed = (int.from_bytes(raw[k : k + 8], "little") for k in (0, 8))
            self.messages += self._codec.decode(self._zstd.decompress(raw[16 : 16 + packed], max_output_size=size))["messages"]

    def appear(self):
        """Sends the camera, upon which the server counts the page as one that is open."""
        self.send("ViewerCameraMessage", wxyz=[1, 0, 0, 0], position=[1, 1, 1], fov=1.0, near=0.1, far=100, image_height=600, image_width=800,
                  look_at=[0, 0, 0], up_direction=[0, 0, 1])  # fmt: skip
        return self

    def uuid(self, label, kind=""):
        """Of the control or key with this label."""
        return next(message["uuid"] for message in self.messages if message["type"].startswith(kind) and message.get("props", {}).get("label") == label)

    def send(self, kind, **fields):
        self.send_raw(self._codec.encode({"type": kind, **fields}))

    def send_raw(self, data):
        self._socket.send(data)

    def set(self, label, value):
        self.send("GuiUpdateMessage", uuid=self.uuid(label), updates={"value": value})

    def reset(self):
        """Ends the connection without a word."""
        self._socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._socket.socket.shutdown(socket.SHUT_RDWR)
        self._socket.socket.close()

    def close(self):
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()


def get(url, *, host=None, origin=None, path=None):
    """Status, headers and body of a request."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=10)
    headers = {"Host": host or parts.netloc, **({"Origin": origin} if origin else {})}
    try:
        connection.request("GET", parts.path if path is None else path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


def eventually(condition, seconds=10):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "this did not happen in time"
        time.sleep(0.02)
