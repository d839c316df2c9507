# SPDX-License-Identifier: Apache-2.0
"""``mjlab.terrains.config``: names and dimensions of the tiles of its velocity tasks."""

from __future__ import annotations

from mjsense.compat.mjlab.terrains import (
    BoxFlatTerrainCfg,
    BoxInvertedPyramidStairsTerrainCfg,
    BoxPyramidStairsTerrainCfg,
    HfPyramidSlopedTerrainCfg,
    HfRandomUniformTerrainCfg,
    HfWaveTerrainCfg,
    TerrainGeneratorCfg,
)

_STAIRS = {"step_height_range": (0.0, 0.1), "step_width": 0.3, "platform_width": 3.0, "border_width": 1.0}
_SLOPE = {"slope_range": (0.0, 1.0), "platform_width": 2.0, "border_width": 0.25}

ROUGH_TERRAINS_CFG = TerrainGeneratorCfg(
    size=(8.0, 8.0),
    border_width=20.0,
    num_rows=10,
    num_cols=20,
    sub_terrains={
        "flat": BoxFlatTerrainCfg(proportion=0.2),
        "pyramid_stairs": BoxPyramidStairsTerrainCfg(proportion=0.2, **_STAIRS),
        "pyramid_stairs_inv": BoxInvertedPyramidStairsTerrainCfg(proportion=0.2, **_STAIRS),
        "hf_pyramid_slope": HfPyramidSlopedTerrainCfg(proportion=0.1, **_SLOPE),
        "hf_pyramid_slope_inv": HfPyramidSlopedTerrainCfg(proportion=0.1, inverted=True, **_SLOPE),
        "random_rough": HfRandomUniformTerrainCfg(proportion=0.1, noise_range=(0.02, 0.10), noise_step=0.02, border_width=0.25),
        "wave_terrain": HfWaveTerrainCfg(proportion=0.1, amplitude_range=(0.0, 0.2), num_waves=4, border_width=0.25),
    },
    add_lights=True,
)
