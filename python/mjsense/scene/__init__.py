# SPDX-License-Identifier: Apache-2.0
"""Scenes: what all worlds share, and which fields of the model may differ between worlds."""

from mjsense.scene.converted_assets import convert_assets
from mjsense.scene.scene import Entity, Scene

__all__ = ["Entity", "Scene", "convert_assets"]
