# SPDX-License-Identifier: Apache-2.0
"""Who may connect to a page, and what reaches the program from there. Everything else is answered with 403 or ignored."""

from __future__ import annotations

import asyncio
import dataclasses
import logging
import secrets
from collections.abc import Callable
from typing import Any

from mjsense.viewer.listening import Listening

MAX_MESSAGE = 2**20
"""Maximum size of a client's message, bytes."""
MAX_CLIENTS = 16
"""Maximum number of pages at the same time. Each one that does not read holds one window of messages in memory."""
_MAX_CONNECTIONS = 256  # also those that have not sent a request
_STALLED = 30.0  # s without any byte taken by a client that has something to receive
_MAX_ANSWERS = 2**16  # bytes of answers to pings that a client has not taken
_HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}
# The page is one file with its scripts. It may load nothing from elsewhere and connect to nothing else.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; style-src 'unsafe-inline'; img-src "
    "data: blob:; font-src data:; "
    "worker-src blob: data:; connect-src 'self' data: blob:{}; base-uri 'none'; form-action 'none'"
)


def _policy(host: str) -> str:
    return _POLICY.format("" if "[" in host else f" ws://{host} wss://{host}")  # 'self' includes these, but not in older browsers


def _quiet_log() -> logging.Logger:
    """websockets' log without the lines about connections that are refused, do not speak HTTP or end."""
    log = logging.getLogger("mjsense.view")
    if not log.filters:
        log.addFilter(
            lambda record: (
                not record.getMessage().startswith(("opening handshake failed", "connection rejected", "keepalive ping failed"))
            )
        )
    return log


class Gate:
    """The conditions under which a server accepts a connection: the token of the printed address, a Host that names this
    computer, and no other Origin."""

    def __init__(self, listening: Listening) -> None:
        self._listening = listening
        self._token = secrets.token_urlsafe(24)
        self.check: Callable[[bytes | str], bytes | None] = lambda _: None
        """Returns a client's message as the program may see it, or None to ignore it."""

    @property
    def url(self) -> str:
        """The address of the page."""
        return f"{self._listening.origin}/{self._token}"

    def options(self, given: dict[str, Any]) -> dict[str, Any]:
        """The arguments of websockets' ``serve`` in place of those that were given."""
        gated = {
            "sock": self._listening.socket,
            "process_request": self._asked(given["process_request"]),
            "create_connection": _connection(self),
            "max_size": MAX_MESSAGE,
            "logger": _quiet_log(),
        }
        return {**given, **gated}

    def _refusal(self, headers: Any, token: str) -> str:
        """Why a request is refused; empty: it is not."""
        host, origin = headers.get_all("Host"), headers.get_all("Origin")
        if len(host) != 1 or not self._listening.answers_to(host[0]):
            return (
                "The address in the request is not one of this program. Open the address that it has printed, "
                "or start it with --host NAME."
            )
        if not secrets.compare_digest(token.encode(errors="replace"), self._token.encode()):
            return "The address has no valid token. Open the whole address that the program printed at its start."
        own = [f"http://{host[0]}".lower(), f"https://{host[0]}".lower()]
        if any(one.lower() not in own for one in origin) or (not origin and "Upgrade" in headers):
            return "The request comes from the page of another server."
        return ""

    def _asked(self, serve_file: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        def process_request(connection: Any, request: Any) -> Any:
            _, _, path = request.path.partition("/")
            token, _, rest = path.partition("?")[0].partition("/")
            if reason := self._refusal(request.headers, token):
                return connection.respond(403, f"{reason}\n")
            if "Upgrade" in request.headers and len(connection.server.connections) >= MAX_CLIENTS:
                return connection.respond(503, f"{MAX_CLIENTS} pages are open: close one.\n")
            response = serve_file(connection, dataclasses.replace(request, path=f"/{rest}"))
            if response is not None:
                for name, value in {**_HEADERS, "Content-Security-Policy": _policy(request.headers["Host"])}.items():
                    response.headers[name] = value
            return response

        return process_request


def _connection(gate: Gate) -> type[Any]:
    """The class of connections, which passes on only messages that ``gate.check`` returns, and ends if its client stops
    reading."""
    from websockets.asyncio.server import ServerConnection

    class Connection(ServerConnection):
        _answers = 0

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            if len(self.server.handlers) > _MAX_CONNECTIONS:
                transport.abort()

        def data_received(self, data: bytes) -> None:
            before = self.transport.get_write_buffer_size()
            super().data_received(data)
            self._answers += max(0, self.transport.get_write_buffer_size() - before)
            if self._answers > _MAX_ANSWERS:
                self.transport.abort()

        def resume_writing(self) -> None:
            self._answers = 0
            super().resume_writing()

        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                message = gate.check(await super().recv(decode))
                if message is not None:
                    return message

        async def send(self, message: Any, text: bool | None = None) -> None:
            sending = asyncio.ensure_future(super().send(message, text))
            waiting = -1
            try:
                while not (await asyncio.wait([sending], timeout=_STALLED))[0]:
                    before, waiting = waiting, self.transport.get_write_buffer_size()
                    if waiting == before:
                        self.transport.abort()
                await sending
            finally:
                sending.cancel()

    return Connection
