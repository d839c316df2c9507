# SPDX-License-Identifier: Apache-2.0
"""A server that offers a policy by openpi's protocol."""

from __future__ import annotations

import asyncio
import http
import logging
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from mjsense import _core
from mjsense.core.optional import optional
from mjsense.core.representations import plain
from mjsense.evaluation.playing import fingerprint
from mjsense.evaluation.remote.access import is_allowed, key_of, server_context
from mjsense.evaluation.remote.adapter import MJSENSE
from mjsense.evaluation.remote.adapters import BUILT_IN
from mjsense.evaluation.remote.messages import MAX_BYTES, pack, unpack
from mjsense.evaluation.remote.served import BadRequest, ServedPolicy

_INTERNAL_ERROR, _TRY_AGAIN_LATER = 1011, 1013  # codes of closed connections
_BYTES_OF_ALL = 512 << 20
"""Limit of one message of each connection together. A connection holds two: one that is answered and the next."""


class PolicyServer:
    """Offers a policy at ``ws://HOST:PORT`` by openpi's protocol, until it is closed. ``GET /healthz`` answers OK.

    A message is a map from names of sensors or streams to arrays,
    ``{"qpos/arm": [7], "wrist_camera": [H, W, 3], "prompt": "Pick up the mug"}``, in which maps may be nested. The answer is
    ``{"actions": [H, n], "server_timing": {"infer_ms": 1.2}}``. A connection is an episode: the policy's ``reset`` is called
    before its first message. All connections share one policy, whose world ids are their numbers. It is called for one message at
    a time. Messages that are wrong, and exceptions of the policy, are answered by their text, after which the connection is
    closed.

    Args:
        policy: See :func:`mjsense.evaluation.policy_from`. Policies that are computed together with their episode, such as
            ``planner``, cannot be served.
        task: Task whose streams and robot the policy knows; only a :class:`mjsense.Policy` and an adapter need it.
        task_options: Further arguments of :func:`mjsense.make_vec`, such as ``robot``, ``camera_system``, ``width`` and
            ``height``.
        policy_options: Arguments of the policy.
        adapter: ``droid``, ``features`` or a TOML file: the names and conventions of the clients' messages, as for
            :class:`RemotePolicy`.
        host: Address to listen at. Every program that can connect to it can use the policy.
        port: Port; 0: any free one.
        connections: Maximum number of connections. Further ones are refused. A message may have 512 MiB / ``connections``, at
            most 64 MiB: 8 MiB with 64 connections.
        key_file: File with a key that clients must have: they send it as ``Authorization: Api-Key KEY``. Empty: no
            key.
        certificate, private_key: PEM files with which the server encrypts its connections, ``wss://HOST:PORT``. Empty: no
            encryption.
        log: Called with a line for each error.
    """

    def __init__(
        self,
        policy: Any,
        *,
        task: str = "",
        task_options: Mapping[str, Any] | None = None,
        policy_options: Mapping[str, Any] | None = None,
        adapter: str = "",
        host: str = "127.0.0.1",
        port: int = 8000,
        connections: int = 64,
        key_file: str = "",
        certificate: str = "",
        private_key: str = "",
        log: Callable[[str], None] | None = None,
    ) -> None:
        if not host:
            raise ValueError(
                "host is empty: must be an address of this computer, such as 127.0.0.1, or 0.0.0.0 for all its networks"
            )
        if not 0 <= port <= 65535:
            raise ValueError(f"port is {port}: must be in [0, 65535]; 0 takes any free port")
        if connections < 1:
            raise ValueError(f"connections is {connections}: must be at least 1")
        if not task and task_options:
            raise ValueError(f"{min(task_options)} belongs to a task, which is missing")
        self._key, self._encryption = key_of(key_file), server_context(certificate, private_key)
        self._library: Any = optional("websockets.asyncio.server", "evaluate", "a policy server")
        self._closed_error: Any = optional("websockets.exceptions", "evaluate", "a policy server").ConnectionClosed
        of_task = {"task": task, **(task_options or {})} if task else {}
        self._served = ServedPolicy(policy, policy_options or {}, of_task, connections, adapter)
        self._log = log or (lambda line: None)
        self._free = list(range(connections))
        self._max_bytes = min(MAX_BYTES, _BYTES_OF_ALL // connections)
        self._episodes = 0
        made = self._served.policy
        about = {"version": _core.__version__, "name": made._mjs_name(), "fingerprint": fingerprint(made)}  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
        about |= {"observation": self._served.observation} | {
            name: getattr(made, name, None) for name in ("execution_horizon", "ensemble")
        }
        if adapter:
            about["adapter"] = adapter if adapter in BUILT_IN else "a file"
        self._metadata = pack({MJSENSE: about})
        self._worker = ThreadPoolExecutor(1, "mjsense served policy")
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="mjsense policy server", daemon=True)
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(self._listen(host, port), self._loop).result()
        except (OSError, UnicodeError) as error:
            self._end_thread()
            raise ValueError(
                f"cannot listen at {plain(host, 60)}, port {port}: {getattr(error, 'strerror', '') or error}"
            ) from None
        address, self.port = self._server.sockets[0].getsockname()[:2]
        scheme = "ws" if self._encryption is None else "wss"
        self.url: str = f"{scheme}://[{address}]:{self.port}" if ":" in address else f"{scheme}://{address}:{self.port}"

    @property
    def name(self) -> str:
        """Name of the policy."""
        return self._served.policy._mjs_name()

    def __enter__(self) -> PolicyServer:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes all connections. A call of the policy that is running ends first."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result()
            self._end_thread()

    def _end_thread(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        self._worker.shutdown()
        self._served.close()

    async def _listen(self, host: str, port: int) -> Any:
        return await self._library.serve(
            self._handle,
            host,
            port,
            compression=None,
            max_size=self._max_bytes,
            max_queue=1,
            origins=[None],  # pages of a browser may not connect
            process_request=self._answer_request,
            ssl=self._encryption,
            close_timeout=2,
            logger=_SILENT,
        )

    def _answer_request(self, link: Any, request: Any) -> Any:
        """The answer to a request that is not to become a connection; None for others."""
        if request.path == "/healthz":
            return link.respond(http.HTTPStatus.OK, "OK\n")
        if self._key and not is_allowed(request.headers, self._key):
            return link.respond(http.HTTPStatus.UNAUTHORIZED, "This server needs the right key.\n")
        return None

    async def _stop(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _handle(self, link: Any) -> None:
        if not self._free:
            await link.send("all connections of this server are taken")
            return await link.close(_TRY_AGAIN_LATER)
        world = self._free.pop(0)
        try:
            await self._converse(link, world)
        except self._closed_error:
            pass
        except Exception as error:
            wrong = isinstance(error, BadRequest)
            self._log(f"connection {world}: {type(error).__name__}: {plain(error)}")
            try:
                await link.send(str(error) if wrong else "".join(traceback.format_exception(error)))
                await link.close(_INTERNAL_ERROR, "The previous message has the error.")
            except self._closed_error:
                pass
        finally:
            self._free.append(world)
            self._free.sort()

    async def _converse(self, link: Any, world: int) -> None:
        await link.send(self._metadata)
        begins = True
        async for data in link:
            begun = time.perf_counter()
            message, arrays = _read(data)
            actions = await self._loop.run_in_executor(self._worker, self._answer, world, message, begins)
            begins = False
            timing = {"infer_ms": 1000 * (time.perf_counter() - begun)}
            await link.send(pack({**self._served.reply(actions), "server_timing": timing}, arrays))

    def _answer(self, world: int, message: Mapping[str, Any], begins: bool) -> Any:
        if begins:
            self._served.begin(world, message, self._episodes)
            self._episodes += 1
        return self._served.answer(world, message)


def _read(data: Any) -> Any:
    if isinstance(data, str):
        raise BadRequest("a message of text; expected an observation in MessagePack")
    try:
        message = unpack(data)
    except ValueError as error:
        raise BadRequest(str(error)) from None
    if not isinstance(message.value, dict):
        raise BadRequest(f"a message is a {type(message.value).__name__}: must be a map")
    return message


_SILENT = logging.Logger("mjsense.websockets", logging.CRITICAL)
