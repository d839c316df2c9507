# SPDX-License-Identifier: Apache-2.0
"""``mjlab.terrains``: a plane, or tiles. Tiles are ours (:class:`mjsense.TerrainCfg`), of mjlab's kinds and measures.

Worlds are spread evenly over the columns, and without ``curriculum`` columns are kinds in proportion, too, instead of a draw for each tile.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco

from mjsense import configs
from mjsense.compat.mjlab.entity import EntityCfg


@dataclass(kw_only=True)
class SubTerrainCfg:
    """One kind of tile."""

    proportion: float = 1.0
    size: tuple[float, float] = (10.0, 10.0)
    flat_patch_sampling: dict[str, Any] | None = None

    def native(self) -> configs.SubTerrainCfg:
        raise NotImplementedError(f"{type(self).__name__} has no counterpart here: see mjsense.SubTerrainCfg for the kinds of tiles")


@dataclass(kw_only=True)
class BoxFlatTerrainCfg(SubTerrainCfg):
    """Flat."""

    def native(self) -> configs.SubTerrainCfg:
        return configs.SubTerrainCfg(kind="flat", proportion=self.proportion)


@dataclass(kw_only=True)
class BoxPyramidStairsTerrainCfg(SubTerrainCfg):
    """Stairs up to a platform."""

    border_width: float = 0.0
    step_height_range: tuple[float, float]
    step_width: float
    platform_width: float = 1.0
    holes: bool = False

    def native(self) -> configs.SubTerrainCfg:
        if self.holes:
            raise NotImplementedError(f"{type(self).__name__}: holes between the stairs are not built here")
        inverted = isinstance(self, BoxInvertedPyramidStairsTerrainCfg)
        low, high = (max(height, 1e-3) for height in self.step_height_range)  # ours have a height
        return configs.SubTerrainCfg(
            kind="stairs", proportion=self.proportion, inverted=inverted, platform_width=self.platform_width,
            step_height=(low, high), step_width=self.step_width)  # fmt: skip


@dataclass(kw_only=True)
class BoxInvertedPyramidStairsTerrainCfg(BoxPyramidStairsTerrainCfg):
    """Stairs down to a platform."""


@dataclass(kw_only=True)
class HfPyramidSlopedTerrainCfg(SubTerrainCfg):
    """Slopes up to a platform, or down."""

    slope_range: tuple[float, float]
    platform_width: float = 1.0
    inverted: bool = False
    border_width: float = 0.0
    horizontal_scale: float = 0.1
    vertical_scale: float = 0.005
    base_thickness_ratio: float = 1.0

    def native(self) -> configs.SubTerrainCfg:
        return configs.SubTerrainCfg(
            kind="slope", proportion=self.proportion, inverted=self.inverted, platform_width=self.platform_width, slope=self.slope_range)


@dataclass(kw_only=True)
class HfRandomUniformTerrainCfg(SubTerrainCfg):
    """Random heights between two."""

    noise_range: tuple[float, float]
    noise_step: float = 0.005
    downsampled_scale: float | None = None
    horizontal_scale: float = 0.1
    vertical_scale: float = 0.005
    base_thickness_ratio: float = 1.0
    border_width: float = 0.0
    scale_with_difficulty: bool = False

    def native(self) -> configs.SubTerrainCfg:
        half = (self.noise_range[1] - self.noise_range[0]) / 2
        return configs.SubTerrainCfg(
            kind="rough", proportion=self.proportion, amplitude=(0.0 if self.scale_with_difficulty else half, half),
            spacing=self.downsampled_scale or self.horizontal_scale)  # fmt: skip


@dataclass(kw_only=True)
class HfWaveTerrainCfg(SubTerrainCfg):
    """Waves in both directions."""

    amplitude_range: tuple[float, float]
    num_waves: int = 1
    horizontal_scale: float = 0.1
    vertical_scale: float = 0.005
    base_thickness_ratio: float = 0.25
    border_width: float = 0.0

    def native(self) -> configs.SubTerrainCfg:
        return configs.SubTerrainCfg(kind="waves", proportion=self.proportion, amplitude=self.amplitude_range, waves=self.num_waves)


@dataclass(kw_only=True)
class TerrainGeneratorCfg:
    """Tiles: rows of rising difficulty, columns of kinds. Colours, lights and the border's height are ours."""

    seed: int | None = None
    curriculum: bool = False
    size: tuple[float, float]
    border_width: float = 0.0
    border_height: float = 1.0
    num_rows: int = 1
    num_cols: int = 1
    color_scheme: str = "height"
    sub_terrains: dict[str, SubTerrainCfg] = field(default_factory=dict)
    difficulty_range: tuple[float, float] = (0.0, 1.0)
    add_lights: bool = False


@dataclass
class TerrainEntityCfg(EntityCfg):
    """The ground. It is matched as the body ``terrain``.

    ``lights``, ``textures`` and ``materials`` are given (anything with ``edit_spec(spec)``; ``()``: none), or there is daylight of ours.
    """

    terrain_type: str = "plane"
    terrain_generator: TerrainGeneratorCfg | None = None
    env_spacing: float | None = 2.0
    max_init_terrain_level: int | None = None
    num_envs: int = 1
    lights: tuple[Any, ...] | None = None  # type: ignore[assignment]
    textures: tuple[Any, ...] | None = None  # type: ignore[assignment]
    materials: tuple[Any, ...] | None = None  # type: ignore[assignment]
    debug_vis: bool = False

    def edit_scene(self, spec: mujoco.MjSpec) -> None:
        """Adds the lights, textures and materials that were given."""
        for edit in (*(self.lights or ()), *(self.textures or ()), *(self.materials or ())):
            edit.edit_spec(spec)

    def native(self) -> configs.TerrainCfg:  # type: ignore[override]
        daylight = self.lights is None and self.textures is None and self.materials is None
        if self.terrain_type == "plane":
            return configs.TerrainCfg(daylight=daylight)
        tiles = self.terrain_generator
        if self.terrain_type != "generator" or tiles is None:
            raise ValueError(f"TerrainEntityCfg: terrain_type is {self.terrain_type!r}: 'plane', or 'generator' with a terrain_generator")
        kinds = {name: sub.native() for name, sub in tiles.sub_terrains.items()}
        if tiles.curriculum:  # a column for each
            kinds = {name: configs.replace(kind, proportion=1.0) for name, kind in kinds.items()}
        top = self.max_init_terrain_level
        return configs.TerrainCfg(
            terrain_type="generator", sub_terrains=kinds, levels=tiles.num_rows, types=0 if tiles.curriculum else tiles.num_cols,
            tile_size=tiles.size, difficulty=tiles.difficulty_range, border=tiles.border_width, seed=tiles.seed or 0,
            max_init_level=-1 if top is None else min(top, tiles.num_rows - 1), daylight=daylight)  # fmt: skip


__all__ = [
    "BoxFlatTerrainCfg",
    "BoxInvertedPyramidStairsTerrainCfg",
    "BoxPyramidStairsTerrainCfg",
    "HfPyramidSlopedTerrainCfg",
    "HfRandomUniformTerrainCfg",
    "HfWaveTerrainCfg",
    "SubTerrainCfg",
    "TerrainEntityCfg",
    "TerrainGeneratorCfg",
]
