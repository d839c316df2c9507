# SPDX-License-Identifier: Apache-2.0
"""Sensors of the user's, written as mjlab's page on sensors describes them: with mjlab's imports changed, and as native ones."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

import mjsense as mjs
from mjsense.compat.mjlab._tensors import HAS_TORCH, tensor
from mjsense.compat.mjlab.entity import EntityCfg
from mjsense.compat.mjlab.scene import Scene, SceneCfg
from mjsense.compat.mjlab.sensor import ContactMatch, ContactSensorCfg, ObjRef, Sensor, SensorCfg
from mjsense.compat.mjlab.sensor.builtin_sensor import BuiltinSensorCfg
from mjsense.compat.mjlab.sensor.contact_sensor import ContactSensor
from mjsense.compat.mjlab.sim import MujocoCfg, Simulation, SimulationCfg
from mjsense.compat.mjlab.terrains import TerrainEntityCfg

if HAS_TORCH:
    import torch

    Tensor = torch.Tensor
else:
    Tensor = np.ndarray

WORLDS = 3


def box():
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="box", pos=(0, 0, 1))
    body.add_freejoint(name="free")
    body.add_geom(name="geom", type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.1, 0.1, 0.1), mass=2)
    return spec


def sensor_classes(Sensor, SensorCfg):
    """A configuration and a sensor as mjlab's users write them, on the base classes of one of the two."""

    @dataclass
    class PeakSpeedCfg(SensorCfg):
        body: str = "box"
        scale: float = 1.0

        def build(self):
            return PeakSpeed(self)

    class PeakSpeed(Sensor[Tensor]):
        """Greatest speed of a body since the reset."""

        def __init__(self, cfg):
            super().__init__()
            self.cfg = cfg
            self.calls = 0

        def edit_spec(self, scene_spec, entities):
            assert self.cfg.body in entities["box"].body_names
            scene_spec.worldbody.add_site(name=f"mark_of_{self.cfg.name}")

        def initialize(self, mj_model, model, data, device):
            assert mj_model.site(f"mark_of_{self.cfg.name}").id >= 0 and device == "cpu"
            self._data = data
            self._address = mj_model.joint("box/free").dofadr[0]
            self._peak = 0 * data.qvel[:, 0]
            self._time = 0.0

        def update(self, dt):
            super().update(dt)
            speed = abs(self._data.qvel[:, self._address + 2])
            self._peak = (self._peak > speed) * self._peak + (self._peak <= speed) * speed
            self._time += dt

        def reset(self, env_ids=None):
            super().reset(env_ids)
            self._peak[slice(None) if env_ids is None else env_ids] = 0

        def _compute_data(self):
            self.calls += 1
            return self._peak[:, None] * self.cfg.scale

    return PeakSpeedCfg, PeakSpeed


def compat(*sensors, **mujoco_options):
    scene = Scene(SceneCfg(num_envs=WORLDS, entities={"box": EntityCfg(spec_fn=box)}, sensors=sensors))
    sim = Simulation(WORLDS, SimulationCfg(mujoco=MujocoCfg(**mujoco_options)), scene.compile())
    return scene, sim


def array(value):
    return np.asarray(value)


def test_user_defined_sensor_in_compat():
    Cfg, PeakSpeed = sensor_classes(Sensor, SensorCfg)
    scene, sim = compat(Cfg("peak", scale=2.0), BuiltinSensorCfg("speed", "framelinvel", ObjRef("body", "box", "box")))
    sensor = scene["peak"]
    assert type(sensor) is PeakSpeed and isinstance(sensor, Sensor) and isinstance(sensor.data, Tensor)
    assert list(scene.sensors) == ["peak", "box/speed"]
    for _ in range(5):
        sim.step()
        scene.update(0.002)
    calls = sensor.calls
    np.testing.assert_allclose(array(sensor.data), 2 * 9.81 * 0.01 * np.ones((WORLDS, 1)), rtol=1e-5)
    assert sensor.data is sensor.data and sensor.calls == calls + 1  # once a step
    assert sensor._time == pytest.approx(0.01)
    scene.reset(tensor(np.array([1])))
    np.testing.assert_allclose(array(sensor.data)[:, 0], 2 * 9.81 * 0.01 * np.array([1, 0, 1]), rtol=1e-5)
    sensor.cfg.scale = 4.0
    assert array(sensor.data)[0, 0] == pytest.approx(2 * 9.81 * 0.01)
    sensor._invalidate_cache()
    assert array(sensor.data)[0, 0] == pytest.approx(4 * 9.81 * 0.01)


def test_the_same_sensor_in_a_native_scene():
    Cfg, PeakSpeed = sensor_classes(mjs.Sensor, mjs.sensors.SensorCfg)
    cfg = Cfg("peak", scale=2.0)
    assert cfg.prefixed_name == "peak" and cfg == Cfg(name="peak", scale=2.0)
    scene = mjs.Scene(mjs.SceneCfg(entities={"box": mjs.EntityCfg(model=box())}, sensors=(cfg,)))
    sim = mjs.Simulation(scene, WORLDS)
    assert type(scene["peak"]) is PeakSpeed and scene["peak"].name == "peak"
    sim.step(5)
    np.testing.assert_allclose(scene["peak"].data, 2 * 9.81 * 0.01 * np.ones((WORLDS, 1)), rtol=1e-5)
    sim.reset([1])
    assert scene["peak"].data[:, 0].tolist() == [scene["peak"].data[0, 0], 0, scene["peak"].data[0, 0]]
    with pytest.raises(TypeError, match="PeakSpeedCfg: name must be a str that is not empty, not 3"):
        Cfg(3)


def test_instances_in_compat():
    class Height(mjs.Sensor):
        uuid = "height"

        def compute(self, sim):
            return {"z": sim.qpos[:, 2].copy(), "words": ["up"] * sim.num_worlds}

    _, PeakSpeed = sensor_classes(Sensor, SensorCfg)
    own = PeakSpeed(sensor_classes(Sensor, SensorCfg)[0]("peak"))
    own.name = "peak"
    height = Height()
    scene, sim = compat(own, height, timestep=0.004)
    assert sim.mj_model.opt.timestep == 0.004 and sim.mj_model is scene.compile() and sim.native.physics_dt == 0.004
    assert scene["peak"] is own and isinstance(own.data, Tensor)
    data = scene["height"].data
    assert isinstance(data["z"], Tensor) and array(data["z"]).tolist() == [1, 1, 1] and data["words"] == ["up"] * WORLDS
    assert scene["height"].uuid == "height" and height.data["z"].tolist() == [1, 1, 1]
    with pytest.raises(RuntimeError, match="sensor 'peak' belongs to another scene"):
        compat(own)
    with pytest.raises(RuntimeError, match="sensor 'height' belongs to another scene"):
        compat(height)


def test_wrong_sensors_in_compat():
    @dataclass
    class NoBuild(SensorCfg):
        pass

    @dataclass
    class WrongBuild(SensorCfg):
        def build(self):
            return 3

    class NoValue(Sensor[Tensor]):
        name = "no_value"

        def _compute_data(self):
            return None

    with pytest.raises(NotImplementedError, match=r"NoBuild: write build\(\)"):
        compat(NoBuild("x"))
    with pytest.raises(TypeError, match=r"WrongBuild.build\(\) must return a Sensor, not 3"):
        compat(WrongBuild("x"))
    with pytest.raises(TypeError, match=r"neither a sensor configuration nor a mjsense\.Sensor: 7"):
        compat(7)
    with pytest.raises(ValueError, match=r"Sensor: a sensor in SceneCfg\.sensors needs a name"):
        compat(Sensor())
    scene, _ = compat(NoValue())
    with pytest.raises(mjs.SensorError, match=r"sensor 'no_value': compute\(\): ValueError: _compute_data\(\) returned None"):
        scene["no_value"].data
    with pytest.raises(RuntimeError, match="NoValue has no data yet"):
        NoValue().data


def test_user_defined_subclass_of_an_mjlab_sensor():
    class Strongest(ContactSensor):
        def _compute_data(self):
            return super()._compute_data().force[..., 2].max()

    @dataclass
    class StrongestCfg(ContactSensorCfg):
        def build(self):
            return Strongest(self)

    cfg = StrongestCfg("touch", ContactMatch("geom", "geom", "box"), ContactMatch("body", "terrain"), reduce="netforce")
    scene = Scene(SceneCfg(num_envs=2, terrain=TerrainEntityCfg(), entities={"box": EntityCfg(spec_fn=box)}, sensors=(cfg,)))
    sim = Simulation(2, SimulationCfg(), scene.compile())
    sim.data.qpos[:, 2] = 0.0999
    sim.forward()
    assert type(scene["touch"]) is Strongest and scene["touch"].primary_names == ["geom"] and scene["touch"].data <= 0


@pytest.mark.parametrize("slots", [1, 4])
def test_netforce_fills_the_first_slot_only(slots):
    """mjlab's page says that num_slots has no effect; its code and MuJoCo's sensor keep the columns, as here."""
    touch = ContactSensorCfg("touch", ContactMatch("geom", "geom", "box"), ContactMatch("body", "terrain"), fields=("found", "force"),
                             reduce="netforce", num_slots=slots)  # fmt: skip
    scene = Scene(SceneCfg(num_envs=2, terrain=TerrainEntityCfg(), entities={"box": EntityCfg(spec_fn=box)}, sensors=(touch,)))
    sim = Simulation(2, SimulationCfg(), scene.compile())
    sim.data.qpos[:, 2] = 0.0999
    sim.forward()
    data = scene["touch"].data
    found, force = array(data.found), array(data.force)
    assert found.shape == (2, slots) and force.shape == (2, slots, 3)
    assert (found[:, 0] == 4).all() and (force[:, 0, 2] < 0).all() and not found[:, 1:].any() and not force[:, 1:].any()


def test_values_after_a_plain_step_are_those_of_the_state_before_it():
    """As in mjlab: poses, sensors and rays follow with forward()."""
    scene, sim = compat(BuiltinSensorCfg("place", "framepos", ObjRef("body", "box", "box")))
    sim.data.qvel[:, 0] = 1
    sim.forward()
    before = array(sim.data.qpos)[:, 0].copy()
    sim.step()
    after = array(sim.data.qpos)[:, 0].copy()
    np.testing.assert_allclose(array(scene["box/place"].data)[:, 0], before, atol=1e-7)
    sim.forward()
    np.testing.assert_allclose(array(scene["box/place"].data)[:, 0], after, atol=1e-7)
    assert (after > before).all()
