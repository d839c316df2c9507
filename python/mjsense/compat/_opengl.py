# SPDX-License-Identifier: Apache-2.0
"""Images for packages that call MuJoCo's renderer themselves: depth in OpenGL's conventions, and their shading."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mjsense.core.errors import nearest

SHADINGS = ("classic", "pbr", "path")


class Look(NamedTuple):
    """The shading of a renderer, and the light from the surroundings."""

    shading: str = "classic"
    environment: str = "model"

    def checked(self, function: str, shadings: tuple[str, ...] = SHADINGS) -> Look:
        """Raises ValueError in the name of `function` for an unknown shading. The environment is checked with the model."""
        if self.shading not in shadings:
            near = nearest(self.shading, list(shadings), cutoff=0.0)
            raise ValueError(f"{function}: unknown shading '{self.shading}'. Nearest: {', '.join(near)}")
        return self

    def give(self, renderer: Any) -> Any:
        renderer.environment, renderer.shading = self.environment, self.shading
        return renderer


def depth_buffer(depth: np.ndarray, scene: Any) -> np.ndarray:
    """Depth in metres as OpenGL stores it: 0 at the near plane of the scene's camera, 1 at the far plane."""
    camera = scene.camera[0]
    near, far = camera.frustum_near, camera.frustum_far
    window = depth - near if camera.orthographic else far * (1 - near / depth)
    return np.clip(window / (far - near), 0, 1).astype(np.float32)
