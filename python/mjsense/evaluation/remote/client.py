# SPDX-License-Identifier: Apache-2.0
"""Connections to a policy server: one for each world and episode, because servers keep the state of an episode for each
connection."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
import sys
import threading
import weakref
from collections.abc import Coroutine, Iterable, Mapping
from typing import Any, TypeVar
from urllib.parse import urlsplit

from mjsense.core.optional import optional
from mjsense.core.representations import plain
from mjsense.evaluation.remote.access import client_context, headers_of
from mjsense.evaluation.remote.adapter import MJSENSE
from mjsense.evaluation.remote.messages import MAX_BYTES, unpack

_MAX_LOSSES = 3  # connections that are lost while the server computes one answer
_FIRST_DELAY, _MAX_DELAY = 0.05, 2.0  # seconds between attempts to connect
_MAX_TEXT = 8000  # characters of a server's error that are shown
_TOO_BIG = 1009  # code of a closed connection
_T = TypeVar("_T")


class Connections:
    """The connections of all worlds to one server. They are served by a thread, which also answers the server's pings.

    Args:
        url: ``ws://HOST:PORT`` or ``wss://HOST:PORT``.
        timeout: Time in which the server must accept a connection, and answer a message. [s]
        patience: Time for which a server that cannot be reached is tried again. [s]
        key: The server's key; empty: none.
        certificate: File with the certificate to trust; empty: those that the system trusts.
    """

    def __init__(self, url: str, *, timeout: float, patience: float, key: str = "", certificate: str = "") -> None:
        self._headers, self._encryption = headers_of(key), client_context(url, certificate)
        self.url, self._timeout, self._patience = checked_url(url), timeout, patience
        self._library: Any = optional("websockets.asyncio.client", "evaluate", "a remote policy")
        self._errors: Any = optional("websockets.exceptions", "evaluate", "a remote policy")
        self._links: dict[int, Any] = {}
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="mjsense remote policy", daemon=True)
        self._thread.start()
        self.fingerprint: Any = None
        """What the server says about its policy's identity. Later connections must say the same."""
        self.lost: dict[int, int] = {}
        """Number of connections that were lost in the current episode, by world."""
        self.close = weakref.finalize(self, _end, self._loop, self._thread, self._links)
        """Closes all connections."""

    def server(self) -> dict[str, Any]:
        """What ``mjsense serve`` says about its policy in its first message; empty: it is another server. The connection is
        closed again."""
        return self._run(self._greeting())

    def begin(self, worlds: Iterable[int]) -> None:
        """New episodes begin in these worlds: their next message has a new connection."""
        self._run(self._begin(list(worlds)))

    def ask(self, questions: Mapping[int, bytes]) -> dict[int, Any]:
        """Sends a message for each of these worlds at once. The answers, or the errors instead of them."""
        answers = self._run(self._ask_all(list(questions.items())))
        return dict(zip(questions, answers, strict=True))

    def _run(self, work: Coroutine[Any, Any, _T]) -> _T:
        running = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return running.result()
        except BaseException:  # Ctrl-C
            running.cancel()
            raise

    async def _begin(self, worlds: list[int]) -> None:
        for world in worlds:
            self.lost[world] = 0
            self._drop(world)

    def _drop(self, world: int) -> None:
        link = self._links.pop(world, None)
        if link is not None:  # the server may need time to answer
            _CLOSING.add(task := self._loop.create_task(link.close()))
            task.add_done_callback(_CLOSING.discard)

    async def _greeting(self) -> dict[str, Any]:
        link, server = await self._persistent(self._connected)
        await link.close()
        self.fingerprint = server.get("fingerprint")
        return server

    async def _ask_all(self, questions: list[tuple[int, bytes]]) -> list[Any]:
        return await asyncio.gather(*(self._ask(*question) for question in questions), return_exceptions=True)

    async def _ask(self, world: int, question: bytes) -> Any:
        for _ in range(_MAX_LOSSES):
            if world not in self._links:
                self._links[world], server = await self._persistent(self._connected)
                if server.get("fingerprint") != self.fingerprint:
                    self._drop(world)
                    raise RuntimeError(f"{self.url} offers another policy than at the start")
            link = self._links[world]
            try:
                return await self._within(self._answer(link, question), "answered a message")
            except self._errors.ConnectionClosed as error:
                self._drop(world)
                self.lost[world] = self.lost.get(world, 0) + 1
                self._raise_if_too_big(error, len(question))
                last = error
            except BaseException:
                self._drop(world)
                raise
        raise ConnectionError(f"{self.url} closed the connection {_MAX_LOSSES} times before it had answered: {plain(last)}")

    async def _answer(self, link: Any, question: bytes) -> Any:
        await link.send(question)
        return self._read(await link.recv())

    async def _connected(self) -> tuple[Any, dict[str, Any]]:
        """A connection, and what ``mjsense serve`` says about its policy."""
        link = await self._without_redirects()(
            self.url,
            compression=None,
            max_size=MAX_BYTES,
            max_queue=1,
            open_timeout=None,  # _within has the limit
            ping_interval=None,  # openpi's servers do not answer pings while they compute
            close_timeout=2,
            logger=_SILENT,
            additional_headers=self._headers,
            ssl=self._encryption,
        )
        try:
            metadata = self._read(await link.recv())
            known = metadata.get(MJSENSE) if isinstance(metadata, dict) else None
            return link, known if isinstance(known, dict) else {}
        except BaseException as error:
            _CLOSING.add(task := self._loop.create_task(link.close()))
            task.add_done_callback(_CLOSING.discard)
            if isinstance(error, self._errors.ConnectionClosed):
                self._raise_if_too_big(error, 0)
            raise

    async def _persistent(self, attempt: Any) -> Any:
        """The result of an attempt that is made until the server can be reached."""
        delay, end = _FIRST_DELAY, self._loop.time() + self._patience
        while True:
            try:
                return await self._within(attempt(), "accepted a connection")
            except self._errors.InvalidStatus as error:
                if error.response.status_code == 401:
                    raise ConnectionError(
                        f"{self.url} needs {'another' if self._headers else 'a'} key: the option key_file"
                    ) from None
                if error.response.status_code < 500:
                    raise ConnectionError(
                        f"{self.url} refuses websockets with the HTTP status {error.response.status_code}"
                    ) from None
                last = error
            except ssl.SSLCertVerificationError as error:
                raise ConnectionError(
                    f"{self.url}: its certificate is not trusted: {error.verify_message}; the option certificate names the "
                    "file of one that is"
                ) from None
            except (TimeoutError, ValueError, RuntimeError):
                raise
            except (OSError, EOFError, self._errors.WebSocketException) as error:
                last = error
            if delay == _FIRST_DELAY:
                print(
                    f"Waiting for the policy server at {self.url}, for at most {self._patience:g} s: "
                    f"{plain(last) or type(last).__name__}",
                    file=sys.stderr,
                )
            if self._loop.time() + delay > end:
                raise ConnectionError(
                    f"no policy server answers at {self.url}, which was tried for {self._patience:g} s: "
                    f"{plain(last) or type(last).__name__}"
                )
            await asyncio.sleep(delay)
            delay = min(2 * delay, _MAX_DELAY)

    async def _within(self, work: Coroutine[Any, Any, _T], what: str) -> _T:
        try:
            return await asyncio.wait_for(work, self._timeout)
        except TimeoutError:
            raise TimeoutError(f"{self.url} has not {what} within {self._timeout:g} s, the option timeout") from None

    def _read(self, message: Any) -> Any:
        if isinstance(message, str):
            text = plain(message, len(message)).strip()
            shown = text if len(text) <= _MAX_TEXT else "... " + text[-_MAX_TEXT:]
            raise RuntimeError(f"{self.url} reports an error:\n{shown}")
        return unpack(message).value

    def _raise_if_too_big(self, error: Any, sent: int) -> None:
        if error.sent is not None and error.sent.code == _TOO_BIG and not error.rcvd_then_sent:
            raise ValueError(f"{self.url} sent a message of more than {MAX_BYTES} bytes, the limit") from None
        if error.rcvd is not None and error.rcvd.code == _TOO_BIG:
            raise ValueError(
                f"{self.url} refuses the observation of {sent} bytes: it is larger than the server's limit, which "
                "is higher with fewer --connections of `mjsense serve`"
            ) from None

    def _without_redirects(self) -> Any:
        class Connect(self._library.connect):
            def process_redirect(self, exc: Exception) -> Exception:
                return exc  # the user named a server, not one to which it points

        return Connect


_CLOSING: set[Any] = set()
"""Tasks that close connections: loops do not keep their tasks alive."""
_SILENT = logging.Logger("mjsense.websockets", logging.CRITICAL)


def checked_url(url: str) -> str:
    """A URL of a websocket. Raises ValueError if it is none."""
    expected = "expected ws://HOST:PORT or wss://HOST:PORT"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise ValueError(f"policy '{plain(url, 120)}': {error}; {expected}") from None
    if parts.scheme not in ("ws", "wss") or not parts.hostname or port == 0 or not url.isprintable() or " " in url:
        raise ValueError(f"policy '{plain(url, 120)}': {expected}")
    if parts.username is not None or parts.fragment:
        raise ValueError(f"policy '{parts.scheme}://...': {expected}, without a user name and without '#'")
    return url


def _end(loop: asyncio.AbstractEventLoop, thread: threading.Thread, links: dict[int, Any]) -> None:
    async def end() -> None:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(asyncio.gather(*(link.close() for link in links.values()), return_exceptions=True), 1)
        loop.stop()

    kept: list[Any] = []
    if thread.is_alive():
        loop.call_soon_threadsafe(lambda: kept.append(loop.create_task(end())))
        thread.join(2)
    if not thread.is_alive():
        loop.close()
