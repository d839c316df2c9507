# SPDX-License-Identifier: Apache-2.0
"""Intervals and tests of success rates.

The formulas: E. B. Wilson, Probable inference, JASA 22 (1927); Q. McNemar, Psychometrika 12 (1947), with the exact binomial
distribution; D. G. Bonett and R. M. Price, Journal of Educational and Behavioral Statistics 37 (2012), for the two added pairs;
R. J. Connor, Biometrics 43 (1987), for the number of pairs.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np

_RESAMPLINGS = 10_000


def wilson(successes: Any, trials: Any, confidence: float = 0.95) -> tuple[Any, Any]:
    """Wilson's interval of a success rate: lower and upper bound, of numbers or arrays. Without trials it is 0 to 1."""
    k, n = np.asarray(successes, float), np.asarray(trials, float)
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    centre = k + z * z / 2
    half = z * np.sqrt(k * (n - k) / np.maximum(n, 1) + z * z / 4)
    # Rounding must not exclude a rate of exactly 0 or 1.
    low = np.where(k == 0, 0.0, (centre - half) / (n + z * z))
    high = np.where(k == n, 1.0, (centre + half) / (n + z * z))
    return (low, high) if low.ndim else (float(low), float(high))


def mcnemar(only_a: int, only_b: int) -> float:
    """Exact two-sided p-value of the hypothesis that both policies have the same success rate.

    Args:
        only_a: Number of episodes in which only A succeeds.
        only_b: Number of episodes in which only B succeeds.
    """
    n = only_a + only_b
    tail = term = 1  # the binomial coefficients of 0 to the smaller number
    for i in range(min(only_a, only_b)):
        term = term * (n - i) // (i + 1)
        tail += term
    return min(1.0, 2 * tail / 2**n)


def paired_difference(only_a: int, only_b: int, pairs: int, confidence: float = 0.95, seed: int = 0) -> tuple[float, float]:
    """Bootstrap interval of the success rate of B minus that of A, over episodes that both play.

    One pair for each policy is added before the episodes are drawn again. Without them, an interval of few or no different pairs
    is too short.
    """
    counts = np.array([only_b + 1, only_a + 1, pairs - only_a - only_b], float)
    total = pairs + 2
    drawn = np.random.default_rng(seed).multinomial(total, counts / total, _RESAMPLINGS)
    low, high = np.quantile((drawn[:, 0] - drawn[:, 1]) / total, [0.5 - confidence / 2, 0.5 + confidence / 2])
    return float(low), float(high)


def episodes_needed(difference: float, differing: float, power: float = 0.8, alpha: float = 0.05) -> int:
    """Number of episodes that both policies must play so that McNemar's test finds a difference of their success rates.

    Args:
        difference: The difference of the success rates, 0 to 1.
        differing: Share of the episodes in which exactly one policy succeeds; at least ``difference``.
        power: Probability of finding the difference.
        alpha: Probability of finding one if there is none.
    """
    if not 0 < difference <= 1:
        raise ValueError(f"episodes_needed(): difference is {difference}: must be in (0, 1]")
    share = min(max(differing, difference), 1.0)
    normal = NormalDist()
    a, b = normal.inv_cdf(1 - alpha / 2), normal.inv_cdf(power)
    return math.ceil((a * math.sqrt(share) + b * math.sqrt(share - difference**2)) ** 2 / difference**2)
