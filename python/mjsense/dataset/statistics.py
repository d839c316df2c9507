# SPDX-License-Identifier: Apache-2.0
"""Statistics of streams, with the names and shapes of LeRobot's ``stats.json``."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
LEVELS = np.arange(256) / 255


def of_rows(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Statistics over the first axis. NaN is skipped; ``count`` is the number of rows with at least one number."""
    values = rows.astype(np.float64)
    finite = np.isfinite(values)
    values = np.where(finite, values, np.nan)
    some = finite.any(0)
    safe = np.where(some, values, 0.0)  # components without any number would warn
    result = {"min": np.nanmin(safe, 0), "max": np.nanmax(safe, 0), "mean": np.nanmean(safe, 0), "std": np.nanstd(safe, 0)}
    quantiles = np.nanquantile(safe, list(QUANTILES.values()), axis=0)
    result |= dict(zip(QUANTILES, quantiles))
    result = {name: np.where(some, np.atleast_1d(value), np.nan) for name, value in result.items()}
    result["count"] = np.array([finite.reshape(len(values), -1).any(1).sum()], np.int64)
    return result


def histograms(frames: Iterable[np.ndarray]) -> tuple[np.ndarray, int]:
    """Histograms int64 [3, 256] of the channels of uint8 images ``[H, W, 3]``, and the number of images."""
    counts = np.zeros((3, 256), np.int64)
    images = 0
    for frame in frames:
        images += 1
        for c in range(3):
            counts[c] += np.bincount(frame[..., c].ravel(), minlength=256)
    return counts, images


def of_images(frames: Iterable[np.ndarray]) -> dict[str, np.ndarray]:
    """Statistics of each channel of uint8 images ``[H, W, 3]``, as 0..1, shape (3, 1, 1). ``count`` is the number of images."""
    return of_histograms(*histograms(frames))


def of_histograms(counts: np.ndarray, images: int, levels: np.ndarray = LEVELS) -> dict[str, np.ndarray]:
    """The same of the result of :func:`histograms`, or of the sums of several. ``levels`` are the values of the bins."""
    below = np.cumsum(counts, 1)
    total = below[:, -1]
    mean = counts @ levels / total

    def ranked(rank: np.ndarray) -> np.ndarray:  # the values at these positions of the sorted pixels of each channel
        return levels[[np.searchsorted(below[c], rank[c], "right") for c in range(len(counts))]]

    result = {"min": ranked(np.zeros(3)), "max": ranked(total - 1), "mean": mean}
    result["std"] = np.sqrt(np.maximum(0, counts @ levels**2 / total - mean**2))
    for name, q in QUANTILES.items():
        at = q * (total - 1)
        low, high = ranked(np.floor(at)), ranked(np.ceil(at))
        result[name] = low + (high - low) * (at - np.floor(at))
    return {name: value.reshape(-1, 1, 1) for name, value in result.items()} | {"count": np.array([images], np.int64)}


def of_depth(frames: Iterable[np.ndarray]) -> dict[str, np.ndarray]:
    """Statistics of depth images, shape (1, 1, 1), over at most about 20,000 evenly spaced pixels of each."""
    pixels = [frame.ravel()[:: max(1, frame.size // 20_000)] for frame in frames]
    result = {name: value.reshape(1, 1, 1) for name, value in of_rows(np.concatenate(pixels)).items()}
    return result | {"count": np.array([len(pixels)], np.int64)}
