# SPDX-License-Identifier: Apache-2.0
"""viser's server behind a gate."""

from __future__ import annotations

import contextlib
import secrets
import threading
import warnings
from collections.abc import Iterator
from typing import Any

from mjsense.core.optional import optional
from mjsense.core.representations import plain
from mjsense.viewer.gate import Gate
from mjsense.viewer.listening import Listening
from mjsense.viewer.messages import Messages
from mjsense.viewer.text import label

_SERIES = "1.1."
_STARTING = threading.Lock()


def import_viser() -> Any:
    """viser, or an error that says how to install it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        viser = optional("viser", "view", "The viewer")
    if not viser.__version__.startswith(_SERIES):
        raise RuntimeError(
            f"The viewer needs viser {_SERIES}*, and viser {plain(viser.__version__)} is installed: pip install 'mjsense[view]'"
        )
    return viser


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without the messages that viser prints."""
    import rich  # pyright: ignore[reportMissingImports]  # a dependency of viser

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        console.quiet = before


@contextlib.contextmanager
def _behind(gate: Gate) -> Iterator[str]:
    """Gives the host of which a server that is made meanwhile is one behind the gate.

    viser has no option for who may connect. It looks ``serve`` of websockets up when it starts, and passes it the host, so
    ``serve`` is replaced until then. The host does not exist, so that no server listens without the gate, and servers of other
    programs stay as they are.
    """
    import websockets.asyncio.server as library

    own, original = f"{secrets.token_hex(8)}.invalid", library.serve

    class Serve(original):
        def __init__(self, handler: Any, host: Any = None, port: Any = None, **options: Any) -> None:
            if host == own:
                host, port, options = None, None, gate.options(options)
            super().__init__(handler, host, port, **options)

    with _STARTING:
        library.serve = Serve
        try:
            yield own
        finally:
            library.serve = original


def serve(title: str, host: str, port: int) -> tuple[Any, Gate, Listening]:
    """A viser server without its own lights, behind a gate. It prints nothing.

    Raises:
        ValueError: This computer cannot listen there.
    """
    viser = import_viser()
    listening = Listening(host, port)
    gate = Gate(listening)
    with _quiet(), _behind(gate) as behind:
        server = viser.ViserServer(host=behind, port=listening.port, label=label(title), verbose=False)
    gate.check = Messages(viser, server)
    server.request_share_url = lambda *_: None  # a page may not ask for a public address
    server.scene.set_up_direction("+z")
    server.scene.configure_default_lights(False)
    server.scene.configure_environment_map(None)
    return server, gate, listening


def stop(server: Any) -> None:
    """Stops a server without a message."""
    with _quiet():
        server.stop()
