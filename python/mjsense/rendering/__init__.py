# SPDX-License-Identifier: Apache-2.0
"""Images of models and data of any MuJoCo, with the interface of ``mujoco.Renderer``."""

from mjsense.rendering.renderer import Renderer

__all__ = ["Renderer"]
