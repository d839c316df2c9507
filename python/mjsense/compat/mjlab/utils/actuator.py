# SPDX-License-Identifier: Apache-2.0
"""``mjlab.utils.actuator``: inertia, speed and effort of a motor as seen at its joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class ElectricActuator:
    """A motor behind its gear: kg m^2, rad/s, N m."""

    reflected_inertia: float
    velocity_limit: float
    effort_limit: float


def reflected_inertia(rotor_inertia: float, gear_ratio: float) -> float:
    """Of a rotor behind one gear stage: J n^2, kg m^2."""
    return rotor_inertia * gear_ratio**2


def reflected_inertia_from_two_stage_planetary(
    rotor_inertia: tuple[float, float, float], gear_ratio: tuple[float, float, float]
) -> float:
    """Of rotor, first and second carrier behind what is left of the gear for each, kg m^2; the first ratio is 1."""
    if gear_ratio[0] != 1:
        raise ValueError(f"gear_ratio begins with {gear_ratio[0]}: must be 1, that of the rotor itself")
    rotor, first, second = rotor_inertia
    return rotor * (gear_ratio[1] * gear_ratio[2]) ** 2 + first * gear_ratio[2] ** 2 + second


def rpm_to_rad(rpm: float) -> float:
    """Converts revolutions per minute to rad/s."""
    return rpm * math.tau / 60


class LinearJointProperties(NamedTuple):
    """kg, m/s, N."""

    armature: float
    velocity_limit: float
    effort_limit: float


def reflect_rotary_to_linear(
    armature_rotary: float, velocity_limit_rotary: float, effort_limit_rotary: float, transmission_ratio: float
) -> LinearJointProperties:
    """A rotary motor that drives a slide joint, r = dx/dangle in m/rad: m = J / r^2, v = w r, F = T / r."""
    r = transmission_ratio
    return LinearJointProperties(armature_rotary / r**2, velocity_limit_rotary * r, effort_limit_rotary / r)
