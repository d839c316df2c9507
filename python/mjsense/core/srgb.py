# SPDX-License-Identifier: Apache-2.0
"""The transfer function of sRGB (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np


def encoded(linear: np.ndarray) -> np.ndarray:
    """Linear colours as sRGB; below 0 and above 1 they are clipped."""
    c = np.clip(linear, 0, 1)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def decoded(srgb: np.ndarray) -> np.ndarray:
    """sRGB colours as linear ones; below 0 and above 1 they are clipped."""
    c = np.clip(srgb, 0, 1)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
