# SPDX-License-Identifier: Apache-2.0
import mujoco
import numpy as np
import pytest

import mjsense as mjs

ROOM = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .1">
      <freejoint/>
      <geom name="box" type="box" size=".1 .1 .1" mass="1"/>
      <site name="top" pos="0 0 .1"/>
      <camera name="eye" pos="0 0 .5" fovy="90"/>
    </body>
  </worldbody>
</mujoco>
"""


class Wind(mjs.Sensor):
    uuid = "wind"

    def compute(self, sim):
        return np.tile([1.0, 0, 0], (sim.num_worlds, 1))

    def debug_vis(self, visualizer):  # as mjlab's sensors write it
        visualizer.add_arrow(np.zeros(3), self.data[visualizer.env_idx], color=(1, 1, 1, 0.5), width=0.1, label="gust")


@pytest.fixture
def sim():
    box = mjs.ObjRef("body", "box", "room")
    sensors = (
        mjs.RayCastSensorCfg(name="scan", frame=box, pattern=mjs.GridPatternCfg((0.6, 0), 0.3), debug_vis=True,
                             viz=mjs.sensors.RayCastVizCfg(show_rays=True, show_normals=True)),
        mjs.ContactSensorCfg(name="touch", primary=mjs.ContactMatch("geom", "box", "room"), num_slots=4, debug_vis=True),
        mjs.CameraSensorCfg(name="eye", camera_name="room/eye", width=8, height=8, debug_vis=True,
                            viz=mjs.sensors.CameraVizCfg(frustum_depth=0.5)),
        mjs.BuiltinSensorCfg(name="gyro", sensor_type="gyro", obj=mjs.ObjRef("site", "top", "room")),
        mjs.BuiltinSensorCfg(name="clock", sensor_type="clock"),
        Wind(),
    )  # fmt: skip
    scene = mjs.Scene(mjs.SceneCfg(entities={"room": mjs.EntityCfg(model=ROOM)}, sensors=sensors))
    sim = mjs.Simulation(scene, num_worlds=2)
    sim.qpos[1, 0] = 1.0  # world 1: everything 1 m to the right
    sim.forward()
    sim.step(300)
    return sim


COUNT = 3 * 3 + 4 * (1 + 3 + 1) + (3 + 8) + 1


def test_shapes_are_plain_data(sim):
    shapes = sim.debug_shapes(world=1)
    assert len(shapes) == COUNT
    n = len(shapes)
    assert shapes.positions.shape == shapes.vectors.shape == (n, 3) and shapes.positions.dtype == np.float64
    assert shapes.widths.shape == (n,) and shapes.rgba.shape == (n, 4) and shapes.rgba.dtype == np.float32
    assert len(shapes.labels) == n
    hits = [i for i, label in enumerate(shapes.labels) if label.startswith("scan_hit")]
    np.testing.assert_allclose(shapes.positions[hits], sim.scene["scan"].data.hit_pos_w[1], atol=1e-6)
    assert (shapes.kinds[hits] == "sphere").all()
    np.testing.assert_allclose(shapes.rgba[hits], [[0, 1, 1, 1]] * 3)
    rays = [i for i, label in enumerate(shapes.labels) if label.startswith("scan_ray")]
    np.testing.assert_allclose(np.linalg.norm(shapes.vectors[rays], axis=1), sim.scene["scan"].data.distances[1], atol=1e-5)

    forces = [i for i, label in enumerate(shapes.labels) if label.endswith("_force")]
    np.testing.assert_allclose(shapes.vectors[forces].sum(0) / sim.model.vis.map.force, [0, 0, -9.81], atol=0.05)

    lines = shapes.of("line")
    assert len(lines) == 8 and set(lines.kinds) == {"line"} and set(lines.labels) == {"eye_frustum"}
    eye = sim.scene["eye"].data.pose[1]
    corners = (lines.positions[:4] - eye[:3, 3]) @ eye[:3, :3]
    np.testing.assert_allclose(corners, [[-0.5, 0.5, -0.5], [0.5, 0.5, -0.5], [0.5, -0.5, -0.5], [-0.5, -0.5, -0.5]], atol=1e-5)
    assert repr(shapes) == "<shapes of world 1: 26 arrow, 8 line, 7 sphere>"


def test_draw_fills_an_mjvscene(sim):
    scene = mujoco.MjvScene(sim.model, maxgeom=100)
    assert sim.draw(scene, world=1) == 0
    assert scene.ngeom == COUNT
    shapes = sim.debug_shapes(world=1)
    geom = scene.geoms[0]
    assert geom.type == mujoco.mjtGeom.mjGEOM_SPHERE and geom.category == mujoco.mjtCatBit.mjCAT_DECOR and geom.label == ""
    np.testing.assert_allclose(geom.pos, shapes.positions[0], atol=1e-6)
    np.testing.assert_allclose(geom.size, 0.5 * sim.model.stat.meansize)
    np.testing.assert_allclose(geom.rgba, [0, 1, 1, 1])
    ray = scene.geoms[1]
    assert ray.type == mujoco.mjtGeom.mjGEOM_ARROW
    np.testing.assert_allclose(ray.mat[:, 2] * ray.size[2], shapes.vectors[1], atol=1e-6)
    scene.ngeom = 0
    sim.draw(scene, labels=True)
    assert scene.geoms[0].label == "scan_hit_0"


def test_full_scene_reports_the_number_of_omitted_shapes(sim):
    scene = mujoco.MjvScene(sim.model, maxgeom=10)
    assert sim.draw(scene) == COUNT - 10
    assert scene.ngeom == 10
    assert sim.draw(scene) == COUNT
    assert scene.ngeom == 10


def test_which_sensors(sim):
    assert set(sim.debug_shapes(sensors="room/gyro").labels) == {"room/gyro_x", "room/gyro_y", "room/gyro_z"}
    one = sim.debug_shapes(sensors=sim.scene["scan"])
    assert len(one) == 9 and len(sim.debug_shapes(sensors=["scan", "wind"])) == 10 and len(sim.debug_shapes(sensors=[])) == 0
    np.testing.assert_array_equal(sim.scene["scan"].debug_shapes(1).positions, sim.debug_shapes(1, "scan").positions)
    gust = sim.scene["wind"].debug_shapes(1)
    assert gust.labels == ["gust"] and gust.env_idx == 1
    np.testing.assert_allclose(gust.vectors, [[1, 0, 0]])


def test_errors(sim):
    scene = mujoco.MjvScene(sim.model, maxgeom=10)
    with pytest.raises(KeyError, match="no sensor named 'scam'; did you mean 'scan'"):
        sim.draw(scene, sensors="scam")
    with pytest.raises(KeyError, match="no sensor named 'room'"):
        sim.draw(scene, sensors=["room"])
    with pytest.raises(TypeError, match="neither a sensor nor the name of one: 3"):
        sim.draw(scene, sensors=[3])
    with pytest.raises(ValueError, match="sensor 'clock': nothing to draw: this clock sensor is attached to nothing"):
        sim.draw(scene, sensors=["clock"])
    with pytest.raises(ValueError, match="world id 2: must be in"):
        sim.draw(scene, world=2)
    with pytest.raises(TypeError, match=r"scene must be a mujoco\.MjvScene, not"):
        sim.draw(sim.model)
    with pytest.raises(ValueError, match="no shape is a 'ball'"):
        sim.debug_shapes().of("ball")
    with pytest.raises(ValueError, match="r, g, b, a"):
        mjs.sensors.DebugShapes().add_sphere((0, 0, 0), 1, (1, 1, 1))

    class Silent(mjs.Sensor):
        uuid = "silent"

        def compute(self, sim):
            return 0

    with pytest.raises(ValueError, match="sensor 'silent' has nothing to draw"):
        sim.draw(scene, sensors=[sim.add(Silent())])


def test_a_frame_and_a_cylinder_of_mjlabs_visualizer():
    shapes = mjs.sensors.DebugShapes()
    shapes.add_frame((1, 0, 0), np.eye(3), scale=2, label="f", alpha=0.5)
    shapes.add_cylinder((0, 0, 0), (0, 0, 1), 0.1, (1, 0, 0, 1))
    np.testing.assert_allclose(shapes.vectors[:3], 2 * np.eye(3))
    assert shapes.labels == ["f_x", "f_y", "f_z", ""]
    np.testing.assert_allclose(shapes.rgba[0], [0.9, 0, 0, 0.5])
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    scene = mujoco.MjvScene(model, maxgeom=10)
    shapes.draw(scene)
    assert scene.geoms[3].type == mujoco.mjtGeom.mjGEOM_CYLINDER
    np.testing.assert_allclose(scene.geoms[3].pos, [0, 0, 0.5])
    shapes.clear()
    assert len(shapes) == 0 and repr(shapes) == "<shapes of world 0: none>"
