# SPDX-License-Identifier: Apache-2.0
"""Images in OpenGL's conventions, which packages that call MuJoCo's renderer themselves expect."""

from __future__ import annotations

from typing import Any

import numpy as np


def depth_buffer(depth: np.ndarray, scene: Any) -> np.ndarray:
    """Depth in metres as OpenGL stores it: 0 at the near plane of the scene's camera, 1 at the far plane."""
    camera = scene.camera[0]
    near, far = camera.frustum_near, camera.frustum_far
    window = depth - near if camera.orthographic else far * (1 - near / depth)
    return np.clip(window / (far - near), 0, 1).astype(np.float32)
