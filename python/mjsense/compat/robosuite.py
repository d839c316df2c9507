# SPDX-License-Identifier: Apache-2.0
"""Camera observations and images of robosuite without OpenGL.

    mjsense.compat.robosuite.use()
    env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True)

``use`` is called before environments are made.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import robosuite.environments.base as base  # pyright: ignore[reportMissingImports]

from mjsense.compat._opengl import Look, depth_buffer
from mjsense.sim.renderer import Renderer


class RenderContext:
    """The part of robosuite's ``MjRenderContextOffscreen`` that environments use. Images start with the bottom row, as there."""

    look = Look()
    """Of contexts that are made from now on."""

    def __init__(self, sim: Any, device_id: int = -1, max_width: int = 640, max_height: int = 480) -> None:
        self.sim, self.device_id, self.offscreen = sim, device_id, True
        sim.forward()
        sim.add_render_context(self)
        self.model, self.data = sim.model, sim.data
        self.scn = mujoco.MjvScene(sim.model._model, maxgeom=10000)
        self.cam = mujoco.MjvCamera()
        self.cam.fixedcamid = 0
        self.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self.vopt = mujoco.MjvOption()
        self.pert = mujoco.MjvPerturb()
        self._renderer = self.look.give(Renderer.of_scene(sim.model._model, self.scn, max_height, max_width))

    def update_offscreen_size(self, width: int, height: int) -> None:
        """Images may have any size."""

    def render(self, width: int, height: int, camera_id: int | None = None, segmentation: bool = False) -> None:
        """Updates the scene; ``read_pixels`` draws it."""
        if camera_id is not None:
            self.cam.type = mujoco.mjtCamera.mjCAMERA_FREE if camera_id == -1 else mujoco.mjtCamera.mjCAMERA_FIXED
            self.cam.fixedcamid = camera_id
        model, data = self.model._model, self.data._data
        mujoco.mjv_updateCamera(model, data, self.cam, self.scn)
        mujoco.mjv_updateScene(model, data, self.vopt, self.pert, self.cam, mujoco.mjtCatBit.mjCAT_ALL, self.scn)

    def read_pixels(self, width: int, height: int, depth: bool = False, segmentation: bool = False) -> Any:
        """rgb uint8 [H, W, 3], or (object type, id) int32 [H, W, 2] with `segmentation`; with `depth` a pair with float32 [H, W],
        0 to 1."""
        color = "segmentation" if segmentation else "rgb"
        images = self._renderer.render_images((color, "depth") if depth else (color,), height=height, width=width)
        image = images[color][::-1]
        image = image[..., ::-1] if segmentation else image
        return (
            (np.ascontiguousarray(image), depth_buffer(images["depth"][::-1], self.scn)) if depth else np.ascontiguousarray(image)
        )

    def upload_texture(self, tex_id: int) -> None:
        """Shows a changed texture in the next image."""
        self._renderer.reload()


def use(shading: str = "classic", environment: str = "model") -> None:
    """Makes all robosuite environments of this process that are made from now on draw with mjsense.

    Args:
        shading: ``classic``: the colours of MuJoCo's OpenGL renderer. ``pbr``: physically based colours. ``path``: path tracing.
        environment: With ``pbr`` and ``path``, the light from the surroundings, as the option of cameras.

    Raises:
        ValueError: For an unknown `shading`.
    """
    RenderContext.look = Look(shading, environment).checked("mjsense.compat.robosuite.use")
    base.MjRenderContextOffscreen = RenderContext
