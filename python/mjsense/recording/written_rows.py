# SPDX-License-Identifier: Apache-2.0
"""Streams of a recording whose rows are written in Python instead of computed by a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mjsense import _core


class WrittenRows:
    """The streams, for a :class:`_core.Recorder`."""

    def __init__(self, num_worlds: int = 1) -> None:
        self._num_worlds = num_worlds
        self.handles: list[Any] = []
        """C++ handles of the streams."""

    def add(self, name: str, dtype: str, shape: Sequence[int], description: str, **more: Any) -> np.ndarray:
        """Declares a stream.

        Args:
            more: Other fields of its specification, such as ``unit``, ``frame``, ``low``, ``high``, and ``video=True`` for images
                that become a video.

        Returns:
            The array ``[B, *shape]`` to write the current rows to.
        """
        spec = {
            "dtype": dtype,
            "shape": [*shape],
            "low": -np.inf,
            "high": np.inf,
            "is_dict": False,
            "unit": "",
            "frame": "",
            "description": description,
            **more,
        }
        return self.add_spec(name, spec)

    def add_spec(self, name: str, spec: dict[str, Any]) -> np.ndarray:
        """As :meth:`add`, with a complete specification."""
        self.handles.append(_core.written_rows(name, spec, self._num_worlds))
        return self.handles[-1].arrays(writable=True)[""]
