# SPDX-License-Identifier: Apache-2.0
"""A viewer in the browser for simulations, tasks and recordings. viser is imported when a viewer is opened."""

from __future__ import annotations

from typing import Any

from mjsense.core.arguments import Seed, checked
from mjsense.core.old_names import old_argument
from mjsense.viewer.plots import plot
from mjsense.viewer.viewer import Viewer

__all__ = ["Viewer", "plot", "view"]


@old_argument("worlds", "num_worlds")
@checked
def view(
    thing: Any,
    *,
    world: int = 0,
    episode: int = 0,
    num_worlds: int = 1,
    seed: Seed = 0,
    host: str = "127.0.0.1",
    port: int = 8080,
    block: bool = True,
    open_browser: bool = True,
    **options: Any,
) -> Viewer:
    """Shows worlds, a task or a recording in the browser.

    The page has play, pause, step and speed, a choice of worlds, reset with a seed, the policy on and off, sliders of controls
    and joints, sensors' shapes, camera images and curves of streams. A recording has a list of its episodes and a time line.

    Args:
        thing: A :class:`Simulation`, an environment, a :class:`Dataset`, the path of a recording or an MJCF, or the name or file
            of a scene or a task.
        world: World to show first.
        episode: Position of a recording's episode to show first.
        num_worlds: Number of worlds, if ``thing`` is a path or a name.
        seed: Seed of the first episode, if ``thing`` is a path or a name.
        host: Address that the server is bound to; the default is reachable from this computer only. The page opens with the
            printed address (:attr:`Viewer.url`), which contains a token.
        port: Port of the server. If it is taken, the next free one is used; 0: any free one.
        block: Run until Ctrl-C or :meth:`Viewer.close`. False: return, and show the present state at every :meth:`Viewer.update`.
        open_browser: Open the page in the default browser.
        options: Options of :func:`make_vec` for a task or a scene, such as ``robot``.

    Returns:
        The viewer, which is closed if ``block`` is true.

    Raises:
        ValueError: This computer cannot listen at this host and port.
        ModuleNotFoundError: viser is not installed.
    """
    from mjsense.viewer.open import source_of, viewer_of

    viewer = viewer_of(
        source_of(thing, num_worlds=max(num_worlds, world + 1), seed=seed, **options),
        world=world,
        episode=episode,
        seed=seed,
        host=host,
        port=port,
    )
    if block:
        viewer.run(open_browser)
    else:
        print(f"Viewer: {viewer.url}", flush=True)
        viewer.open(open_browser)
    return viewer
