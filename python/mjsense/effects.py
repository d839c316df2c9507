"""What real sensors do to a value. Effects wrap a sensor of the scene, in this order, in its unit and in seconds::

    mjs.EffectSensorCfg(name="imu", sensor="robot/imu_acc", effects=(
        effects.EpisodeBias(effects.Gaussian(0.05)), effects.Noise.with_density(0.002), effects.Delay(0.004)))

The clean sensor stays readable. Random numbers depend on the seed, the world, the sensor and the step alone. A number per
component may stand wherever one number may.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from mjsense._field_docs import show_field_docs
from mjsense.configs import Config, SensorCfg

PerComponent = float | Sequence[float]


class Draw(Config):
    """Base of random numbers."""


class Effect(Config):
    """Base of all effects."""


@dataclass(frozen=True)
class Gaussian(Draw):
    """Normal distribution."""

    kind: ClassVar[str] = "gaussian"
    std: PerComponent = 0.0
    mean: PerComponent = 0.0


@dataclass(frozen=True)
class Uniform(Draw):
    """[low, high)."""

    kind: ClassVar[str] = "uniform"
    low: PerComponent = 0.0
    high: PerComponent = 0.0


@dataclass(frozen=True)
class Constant(Draw):
    """Always the same."""

    kind: ClassVar[str] = "constant"
    value: PerComponent = 0.0


@dataclass(frozen=True)
class Noise(Effect):
    """A new error for every row and component."""

    kind: ClassVar[str] = "noise"
    draw: Any = Gaussian()
    """Gaussian, Uniform or Constant."""
    operation: str = "add"
    """add, scale, or abs (the error replaces the value)."""
    density: PerComponent = 0.0
    """unit / sqrt(Hz), the noise density of a data sheet: std = density / sqrt(period), on top of draw."""
    fields: Sequence[str] = ()
    """Of the sensor; empty: all."""

    @classmethod
    def with_density(cls, density: PerComponent, **kwargs: Any) -> Noise:
        return cls(density=density, **kwargs)


@dataclass(frozen=True)
class EpisodeBias(Effect):
    """A constant error within an episode (turn-on bias)."""

    kind: ClassVar[str] = "episode_bias"
    draw: Any = Gaussian()
    operation: str = "abs"
    """At every reset: abs draws the bias anew, add lets it walk from episode to episode."""
    per_component: bool = True
    """False: one number for the whole row."""
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class BiasDrift(Effect):
    """First-order Gauss-Markov bias; with an infinite time constant a random walk."""

    kind: ClassVar[str] = "bias_drift"
    std: PerComponent = 0.0
    """Of the stationary process."""
    time_constant_s: float = math.inf
    density: PerComponent = 0.0
    """unit / sqrt(s), of the random walk."""
    start_at_zero: bool = False
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Scale(Effect):
    """x <- factor x."""

    kind: ClassVar[str] = "scale"
    factor: PerComponent = 1.0
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Misalignment(Effect):
    """Scale errors and small rotations of every three components, fixed plus drawn at every reset."""

    kind: ClassVar[str] = "misalignment"
    scale_error: Sequence[float] = (0.0, 0.0, 0.0)
    angle: Sequence[float] = (0.0, 0.0, 0.0)
    """rad about x, y, z."""
    scale_error_std: float = 0.0
    angle_std: float = 0.0
    """rad."""
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Clip(Effect):
    """Limits of a device, or of an observation."""

    kind: ClassVar[str] = "clip"
    low: PerComponent = -math.inf
    high: PerComponent = math.inf
    fields: Sequence[str] = ()

    @classmethod
    def saturation(cls, limit: float, **kwargs: Any) -> Clip:
        return cls(-limit, limit, **kwargs)


@dataclass(frozen=True)
class Quantize(Effect):
    """Rounds to multiples of step."""

    kind: ClassVar[str] = "quantize"
    step: PerComponent = 0.0
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class NanPolicy(Effect):
    """What becomes of NaN and infinite values."""

    kind: ClassVar[str] = "nan_policy"
    action: str = "sanitize"
    """disabled, warn, sanitize (0), error."""
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Delay(Effect):
    """The row of delay_s ago."""

    kind: ClassVar[str] = "delay"
    delay_s: float = 0.0
    delay_max_s: float = 0.0
    """Larger than delay_s: drawn between them for each world and episode."""
    jitter_s: float = 0.0
    interpolate: bool = False
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class StepDelay(Effect):
    """mjlab's delay, in control steps."""

    kind: ClassVar[str] = "step_delay"
    min_lag: int = 0
    max_lag: int = 0
    per_world: bool = True
    hold_probability: float = 0.0
    update_period: int = 0
    per_world_phase: bool = True
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Rate(Effect):
    """A device slower than the control loop: rows are held in between."""

    kind: ClassVar[str] = "rate"
    rate_hz: float = 0.0
    phase_s: float = 0.0
    random_phase: bool = False
    fields: Sequence[str] = ()


@dataclass(frozen=True)
class Dropout(Effect):
    """A row is lost with this probability."""

    kind: ClassVar[str] = "dropout"
    probability: float = 0.0
    mode: str = "hold"
    """What is given instead: hold (the last row), nan, zero."""
    fields: Sequence[str] = ()


@dataclass
class EffectSensorCfg(SensorCfg):
    """A sensor of the scene seen through effects; it has the same fields."""

    kind: ClassVar[str] = "effect"
    sensor: str = ""
    """Key of the clean sensor: ``robot/imu_acc``."""
    effects: Sequence[Any] = ()
    fields: Sequence[str] = ()
    """Of the clean sensor; empty: all."""
    history_length: int = 0
    """Rows of every field, oldest first; the first of an episode fills all. 0: no history."""
    flatten_history: bool = True


show_field_docs(__name__)
