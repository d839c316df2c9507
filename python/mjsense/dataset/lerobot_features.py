# SPDX-License-Identifier: Apache-2.0
"""The features of a LeRobot data set, as its info.json states them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mjsense.dataset import foreign_values as foreign

_TYPES = ("float16", "float32", "float64", "bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_BLOCK = 16  # pixels


class Feature:
    """One entry of ``features``."""

    def __init__(self, key: str, about: Any, place: str) -> None:
        about = foreign.mapping(about, place)
        foreign.text(key, place, 200)
        self.dtype = foreign.text(about.get("dtype"), f"{place}: dtype", 40)
        if self.dtype not in (*_TYPES, "video", "image", "string"):
            raise ValueError(
                f"{place}: dtype is {foreign.found(self.dtype)}, expected one of {', '.join(_TYPES)}, video, image, string"
            )
        self.is_image = self.dtype in ("video", "image")
        shape = about.get("shape")
        if not isinstance(shape, list) or not 1 <= len(shape) <= 8:
            raise ValueError(f"{place}: shape is {foreign.found(shape)}, expected a list of whole numbers")
        sizes = [foreign.whole(size, f"{place}: shape", 1, 10**6) for size in shape]
        if (count := math.prod(sizes)) > foreign.MAX_ROW_NUMBERS and not self.is_image:
            raise ValueError(f"{place}: shape has {count} numbers, the limit is {foreign.MAX_ROW_NUMBERS}")
        names = about.get("names")
        if isinstance(names, dict):
            names = [name for part in names.values() for name in (part if isinstance(part, list) else [part])]
        if names is not None and not (isinstance(names, list) and all(isinstance(name, (str, int)) for name in names)):
            raise ValueError(f"{place}: names is {foreign.found(names)}, expected a list of texts")
        self.names = [str(name)[:200] for name in names or []]
        info = foreign.mapping(about.get("info") or about.get("video_info") or {}, f"{place}: info")
        self.is_depth = bool(info.get("is_depth_map") or info.get("video.is_depth_map"))
        self._info, self._place = info, place
        self.shape: tuple[int, ...] = self._image_shape(sizes) if self.is_image else () if sizes == [1] else tuple(sizes)
        """Height and width of images, or the shape of other values."""
        if self.is_depth:
            self._depth = [
                foreign.number(info.get(f"video.{name}"), f"{place}: video.{name}", 0, 1e6)
                for name in ("depth_min", "depth_max", "shift")
            ]
            if not self._depth[0] + self._depth[2] > 0 or not self._depth[0] < self._depth[1]:
                raise ValueError(
                    f"{place}: depths from {self._depth[0]} to {self._depth[1]} m with a shift of {self._depth[2]} "
                    "m, expected rising values above 0"
                )

    def _image_shape(self, sizes: list[int]) -> tuple[int, int]:
        """Height and width, wherever the channels are: by their name, or else by their number."""
        if len(sizes) not in (2, 3):
            raise ValueError(f"{self._place}: shape is {sizes}, expected height, width and channels")
        if len(sizes) == 2:
            return foreign.image_shape(sizes[0], sizes[1], f"{self._place}: shape")
        names = self.names if len(self.names) == 3 else []
        named = [i for i, name in enumerate(names) if name.lower() in ("channel", "channels", "c")]
        last = named[0] == 2 if named else sizes[2] in (1, 3, 4)
        if sizes[2 if last else 0] not in (1, 3, 4):
            raise ValueError(
                f"{self._place}: shape is {sizes} with the names {self.names}, expected 1, 3 or 4 channels at its start or end"
            )
        height, width = sizes[:2] if last else sizes[1:]
        return foreign.image_shape(height, width, f"{self._place}: shape")

    def check_size(self, height: int, width: int, place: str) -> None:
        """Encoders may add rows and columns, up to their block size."""
        if not (0 <= height - self.shape[0] < _BLOCK and 0 <= width - self.shape[1] < _BLOCK):
            raise ValueError(
                f"{place}: has images of {height} x {width} pixels, and info.json states {self.shape[0]} x {self.shape[1]}"
            )

    def depth(self, codes: np.ndarray) -> np.ndarray:
        near, far, shift = self._depth
        part = codes.astype(np.float64) / 4095
        if not self._info.get("video.use_log", True):
            return (near + part * (far - near)).astype(np.float32)
        return (np.exp(np.log(near + shift) + part * np.log((far + shift) / (near + shift))) - shift).astype(np.float32)
