# SPDX-License-Identifier: Apache-2.0
"""Sensors with effects applied (``EffectSensorCfg``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mjsense.warp.effects import Chain, needs_every_step
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, declared, implements

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor


class ChainSensor(WarpSensor):
    """A sensor whose fields are those of other arrays with effects applied; a subclass makes ``chains``."""

    chains: list[Chain]

    def update(self) -> None:
        for chain in self.chains:
            chain.apply()

    def reset(self, mask: Any) -> None:
        for chain in self.chains:
            chain.reset(mask)

    def check(self) -> None:
        """Raises an error for values that a NanPolicy refuses. Reads from the device; update() must have run."""
        for chain in self.chains:
            chain.check()


@implements("effect")
class EffectSensor(ChainSensor):
    needs = Stage.NONE

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        cfg, clean = self.cfg, worlds.sensors[self.cfg.sensor]
        self.inputs = (clean,)
        self.fields = declared(worlds, sensor)
        self.chains = []
        for name, out in self.fields.items():
            effects = [effect for effect in cfg.effects if not effect.fields or name in effect.fields]
            stream = f"{self.name}/{name}" if name else self.name
            self.chains.append(Chain(worlds, effects, stream, clean.fields[name], out, cfg.history_length))
            self.every_step |= needs_every_step(effects, cfg.history_length)
