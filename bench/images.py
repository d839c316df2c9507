# SPDX-License-Identifier: Apache-2.0
"""Writes images side by side and computes how much they differ."""

from __future__ import annotations

import pathlib

import numpy as np

from mjsense.core.png import png_of


def write_png(path: pathlib.Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png_of(image))


def write_sheet(path: pathlib.Path, *images: np.ndarray) -> None:
    """Writes the images side by side; small images are enlarged."""
    scale = max(1, 300 // images[0].shape[0])
    write_png(path, np.concatenate([image.repeat(scale, 0).repeat(scale, 1) for image in images], axis=1))


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Structural similarity of luminance: Wang et al. 2004, Gaussian window of 11 pixels, sigma 1.5."""
    kernel = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    kernel /= kernel.sum()

    def blur(x: np.ndarray) -> np.ndarray:
        for axis in (0, 1):
            x = np.apply_along_axis(lambda row: np.convolve(row, kernel, "valid"), axis, x)
        return x

    a, b = (x.astype(float) @ (0.299, 0.587, 0.114) for x in (a, b))
    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2
    cov = blur(a * b) - mean_a * mean_b
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return float((((2 * mean_a * mean_b + c1) * (2 * cov + c2)) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))).mean())


def same_depth(a: np.ndarray, b: np.ndarray) -> float:
    """Percentage of pixels whose depths agree within 1 cm, among the pixels in which at least one image has a surface."""
    return float(100 * (np.abs(a - b) < 0.01)[(a > 0) | (b > 0)].mean())
