# SPDX-License-Identifier: Apache-2.0
"""User code that runs inside a simulation, an environment or a recording may read the worlds but not step or reset them."""

import gymnasium
import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs

CALLS = {
    "step": lambda sim: sim.step(),
    "step_raw": lambda sim: sim.step_raw(1),
    "reset": lambda sim: sim.reset(),
    "forward": lambda sim: sim.forward(),
    "randomize": lambda sim: sim.randomize("geom_friction", 1.0),
    "close": lambda sim: sim.close(),
}


class Mover(mjs.Sensor):
    def __init__(self, call):
        super().__init__("mover", gymnasium.spaces.Box(-1, 1, (1,), np.float32))
        self.call = call

    def compute(self, sim):
        self.call(sim)
        return np.zeros((sim.num_worlds, 1), np.float32)


class UpdatingMover(Mover):
    def update(self, dt):
        self.call(self.simulation)

    def compute(self, sim):
        return np.zeros((sim.num_worlds, 1), np.float32)


def in_simulation(sensor, tmp_path):
    sim = mjs.Simulation(ball_scene(), num_worlds=2)
    sim.add(sensor)
    sim.step()
    return sensor.rows


def in_recording(sensor, tmp_path):
    mjs.record("pick", out=tmp_path / "out", num_worlds=2, horizon=3, max_attempts=1, cameras=[], sensors=[sensor], keep_failures=True)


def in_environment(sensor, tmp_path):
    env = mjs.make_vec("pick", num_envs=2, cameras=[], sensors=[sensor])
    try:
        env.reset(seed=0)
        env.step(env.action_space.sample())
    finally:
        env.close()


@pytest.mark.parametrize("place", [in_simulation, in_recording, in_environment])
@pytest.mark.parametrize("kind", [Mover, UpdatingMover])
@pytest.mark.parametrize("name", CALLS)
def test_worlds_cannot_be_changed_during_a_step(name, kind, place, tmp_path):
    if place is not in_simulation and name not in ("step", "reset"):
        pytest.skip("the same code as in a simulation")
    with pytest.raises(mjs.SensorError, match=rf"sensor 'mover': .*{name}\(\) was called while the simulation is running"):
        place(kind(CALLS[name]), tmp_path)
