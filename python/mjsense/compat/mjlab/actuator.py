# SPDX-License-Identifier: Apache-2.0
"""``mjlab.actuator``: the actuators that MuJoCo computes. Each configuration adds its actuators to the entity's spec."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import mujoco


class TransmissionType(StrEnum):
    """The kind of element that an actuator drives."""

    JOINT = "joint"
    TENDON = "tendon"
    SITE = "site"


_TRANSMISSIONS = {
    TransmissionType.JOINT: mujoco.mjtTrn.mjTRN_JOINT,
    TransmissionType.TENDON: mujoco.mjtTrn.mjTRN_TENDON,
    TransmissionType.SITE: mujoco.mjtTrn.mjTRN_SITE,
}


@dataclass(kw_only=True)
class ActuatorCfg:
    """Base class. ``target_names_expr`` match whole names of joints, tendons or sites; None keeps the value in the XML."""

    target_names_expr: tuple[str, ...]
    transmission_type: TransmissionType = TransmissionType.JOINT
    armature: float | None = None
    frictionloss: float | None = None
    viscous_damping: float | None = None
    delay_min_lag: int = 0
    delay_max_lag: int = 0
    delay_hold_prob: float = 0.0
    delay_update_period: int = 0
    delay_per_env_phase: bool = True

    def edit_spec(self, spec: mujoco.MjSpec, names: list[str]) -> None:
        """Adds an actuator for each name. Raises NotImplementedError for features that only mjlab computes."""
        if self.delay_max_lag > 0:
            raise NotImplementedError(f"{type(self).__name__}: delays of commands (delay_max_lag) are not computed here")
        for name in names:
            self._add(spec, name)
            self._override(spec, name)

    def _add(self, spec: mujoco.MjSpec, name: str) -> None:
        raise NotImplementedError(
            f"{type(self).__name__} is computed by mjlab in Python; here are BuiltinPositionActuatorCfg, "
            "BuiltinVelocityActuatorCfg, BuiltinMotorActuatorCfg and XmlActuatorCfg"
        )

    def _actuator(self, spec: mujoco.MjSpec, name: str, effort_limit: float | None) -> Any:
        actuator = spec.add_actuator(name=name, target=name, trntype=_TRANSMISSIONS[self.transmission_type])
        actuator.dyntype, actuator.gaintype = mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtGain.mjGAIN_FIXED
        actuator.forcelimited = effort_limit is not None
        if effort_limit is not None:
            actuator.forcerange[:] = -effort_limit, effort_limit
        return actuator

    def _override(self, spec: mujoco.MjSpec, name: str) -> None:
        if self.transmission_type == TransmissionType.SITE:
            return
        target = spec.joint(name) if self.transmission_type == TransmissionType.JOINT else spec.tendon(name)
        if self.armature is not None:
            target.armature = self.armature
        if self.frictionloss is not None:
            target.frictionloss = self.frictionloss
        if self.viscous_damping is not None:
            target.damping[0] = self.viscous_damping


@dataclass(kw_only=True)
class BuiltinPositionActuatorCfg(ActuatorCfg):
    """Force = stiffness (ctrl - q) - damping dq/dt, within +-effort_limit; ctrl may exceed the joint's range."""

    stiffness: float
    damping: float
    effort_limit: float | None = None

    def _add(self, spec: mujoco.MjSpec, name: str) -> None:
        actuator = self._actuator(spec, name, self.effort_limit)
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[1], actuator.biasprm[2] = self.stiffness, -self.stiffness, -self.damping
        actuator.inheritrange, actuator.ctrllimited = 0.0, False
        if self.effort_limit is not None:  # the force saturates beyond this range; ctrllimited is off, so it is information only
            joint = self.transmission_type == TransmissionType.JOINT
            low, high = (spec.joint(name) if joint else spec.tendon(name)).range
            reach = self.effort_limit / self.stiffness
            actuator.ctrlrange[:] = low - reach, high + reach


@dataclass(kw_only=True)
class BuiltinVelocityActuatorCfg(ActuatorCfg):
    """Force = damping (ctrl - dq/dt), within +-effort_limit."""

    damping: float
    effort_limit: float | None = None

    def _add(self, spec: mujoco.MjSpec, name: str) -> None:
        actuator = self._actuator(spec, name, self.effort_limit)
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.inheritrange, actuator.ctrllimited = 0.0, False
        actuator.gainprm[0], actuator.biasprm[2] = self.damping, -self.damping


@dataclass(kw_only=True)
class BuiltinMotorActuatorCfg(ActuatorCfg):
    """Force = gear ctrl, within +-effort_limit."""

    effort_limit: float
    gear: float = 1.0

    def _add(self, spec: mujoco.MjSpec, name: str) -> None:
        actuator = self._actuator(spec, name, self.effort_limit)
        actuator.biastype = mujoco.mjtBias.mjBIAS_NONE
        actuator.gear[0], actuator.ctrllimited = self.gear, True
        actuator.ctrlrange[:] = -self.effort_limit, self.effort_limit


@dataclass(kw_only=True)
class XmlActuatorCfg(ActuatorCfg):
    """Uses the XML's actuators of the targets. Raises ValueError for a target without an actuator."""

    command_field: str | None = None

    def _add(self, spec: mujoco.MjSpec, name: str) -> None:
        if not any(actuator.target == name for actuator in spec.actuators):
            raise ValueError(f"XmlActuatorCfg: the XML has no actuator of '{name}'")


__all__ = [
    "ActuatorCfg",
    "BuiltinMotorActuatorCfg",
    "BuiltinPositionActuatorCfg",
    "BuiltinVelocityActuatorCfg",
    "TransmissionType",
    "XmlActuatorCfg",
]
