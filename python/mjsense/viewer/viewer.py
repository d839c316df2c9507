# SPDX-License-Identifier: Apache-2.0
"""The viewer: a server, the scene of one world, and panels next to it."""

from __future__ import annotations

import os
import sys
import threading
import time
import webbrowser
from collections.abc import Callable
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.representations import plain
from mjsense.viewer.layer import ShapeLayer
from mjsense.viewer.stage import Stage

_FRAME = 1 / 30  # s between two frames
_IDLE = 0.1  # s between two looks for a browser or for events while nothing moves


@checked
class Viewer:
    """A web page that shows one world at a time; created by :func:`mjsense.view`.

    All work is done in the thread that calls :meth:`update` or :meth:`run`: the browser's events wait until then.
    """

    def __init__(self, title: str, host: str, port: int) -> None:
        from mjsense.viewer.server import serve, stop  # with asyncio, which is slow to import

        self._stop = stop
        self._server, gate, listening = serve(title, host, port)
        self.port: int = listening.port
        """The port of the server."""
        self.url: str = gate.url
        """The address of the page, with the token that the server asks for."""
        if self.port != port and port:
            print(f"Port {port} is taken: the viewer uses port {self.port}.", flush=True)
        if not listening.local:
            print(
                f"The viewer listens at {listening.address}: every person on the network who has the address below, "
                "with this computer's name in it, "
                "can watch and drive, and the connection is not encrypted.",
                flush=True,
            )
        self._server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
        self._stage, self._layer = Stage(self._server), ShapeLayer(self._server)
        self._events: dict[int, Callable[[], None]] = {}
        self._lock, self._wake = threading.Lock(), threading.Event()
        self._closed = self._playing = False
        self._start()

    def _later(self, handle: Any, action: Callable[[], None]) -> None:
        """Runs ``action`` in the viewer's thread after the user has changed or clicked a control; of several changes the last
        counts."""

        async def note(event: Any) -> None:  # runs in the server's thread: messages that come faster do not pile up
            if event.client is not None:  # None: the program has set the value
                with self._lock:
                    self._events[id(handle)] = action
                self._wake.set()

        (handle.on_click if hasattr(handle, "on_click") else handle.on_update)(note)

    def _add_groups(self, gui: Any) -> None:
        boxes = [gui.add_checkbox(f"Group {k}", initial_value=k in self._stage.groups) for k in range(6)]
        sites = gui.add_checkbox("Sites", initial_value=self._stage.sites)

        def show() -> None:
            self._stage.show_groups({k for k, box in enumerate(boxes) if box.value}, sites.value)
            self._show()

        for box in (*boxes, sites):
            self._later(box, show)

    def _add_play(self, gui: Any) -> None:
        """Adds the button that starts and stops time."""
        self._button = gui.add_button("Play", hint="Start or stop; the speed is below.")
        self._later(self._button, lambda: self._set_playing(not self._playing))

    def _set_playing(self, playing: bool) -> None:
        self._playing = playing
        self._button.label = "Pause" if playing else "Play"
        self._start()

    def _start(self) -> None:
        """Counts time from now on."""
        self._due = time.perf_counter()

    def _look(self, position: np.ndarray, target: np.ndarray, fov: float) -> None:
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = position, target, fov

    def _handle_events(self) -> bool:
        self._wake.clear()
        with self._lock:
            events, self._events = self._events, {}
        for action in events.values():
            self._do(action)
        return bool(events)

    def _do(self, action: Callable[[], None]) -> None:
        """Does what the user wants. What is not possible, such as showing a damaged episode, does not end the viewer."""
        try:
            action()
        except (ValueError, RuntimeError, OSError, KeyError) as error:
            print(
                f"The viewer cannot do this: {plain(' '.join([str(error), *getattr(error, '__notes__', ())]), 1000)}", flush=True
            )

    @property
    def watched(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self._server.get_clients())

    def update(self) -> None:
        """Handles the user's input and shows the present state. Call it after each step of a loop of your own."""
        self._handle_events()
        self._show()

    def open(self, open_browser: bool = True) -> None:
        """Opens the page in the default browser. Without one, the address is to be opened by hand."""
        if not open_browser:
            return
        display = sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if not display or not webbrowser.open(self.url):  # without a display, a browser for terminals would be started
            print(f"There is no browser here: open {self.url} in one.", flush=True)

    def run(self, open_browser: bool = True) -> None:
        """Shows the worlds until Ctrl-C or :meth:`close`."""
        try:
            print(f"Viewer: {self.url} (Ctrl-C ends it)", flush=True)
            self.open(open_browser)
            while not self._closed:
                began = time.perf_counter()
                busy = self._handle_events()
                if self._closed:
                    break
                busy |= self._advance(began) if self.watched else False
                self._wake.wait(max(0.0, began + (_FRAME if busy else _IDLE) - time.perf_counter()))
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """Stops the server."""
        if not self._closed:
            self._closed = True
            self._wake.set()
            self._stop(self._server)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def _advance(self, now: float) -> bool:
        """Moves on to this time of ``perf_counter``. Returns whether there is something new to see soon."""
        raise NotImplementedError

    def _show(self) -> None:
        raise NotImplementedError
