# SPDX-License-Identifier: Apache-2.0
import mujoco
import numpy as np
import pytest

import mjsense as mjs

TABLE = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <geom name="box" type="box" size=".5 .5 .25" pos="1 0 .25" rgba="1 0 0 1"/>
    <body name="head" pos="0 0 4"><camera name="eye" fovy="60"/></body>
    <light pos="0 0 4" dir="0 0 -1"/>
  </worldbody>
</mujoco>
"""


def scene(*sensors):
    return mjs.Scene(mjs.SceneCfg(entities={"room": mjs.EntityCfg(model=TABLE)}, sensors=sensors))


def test_fields_and_shapes():
    camera = mjs.CameraSensorCfg(name="eye", camera_name="room/eye", width=32, height=24, data_types=("rgb", "depth", "segmentation"))
    s = scene(camera)
    mjs.Simulation(s, num_worlds=2)
    data = s["eye"].data
    assert data.rgb.shape == (2, 24, 32, 3) and data.rgb.dtype == np.uint8
    assert data.depth.shape == (2, 24, 32, 1) and data.depth.dtype == np.float32
    assert data.segmentation.shape == (2, 24, 32, 2) and data.segmentation.dtype == np.int32
    assert data.normals is None
    assert data.depth[0, 12, 8, 0] == pytest.approx(4, abs=1e-4)
    red = data.rgb[0, 12, 24].astype(int)
    assert red[0] > 2 * red[1]  # +x is to the right


def test_flow_of_a_zoom_in_one_world():
    camera = mjs.CameraSensorCfg(name="eye", camera_name="room/eye", width=32, height=24, data_types=("flow",))
    s = scene(camera)
    sim = mjs.Simulation(s, num_worlds=2)
    assert (s["eye"].data.flow == 0).all()
    sim.step()
    sim.randomize("cam_fovy", 40.0, world_ids=[1])
    assert s["eye"].specs["flow"].shape == (24, 32, 2) and s["eye"].specs["flow"].unit == "pixels"
    flow = s["eye"].data.flow
    assert flow.shape == (2, 24, 32, 2) and flow.dtype == np.float32
    assert (flow[0] == 0).all()
    v, u = np.mgrid[:24, :32] + 0.5
    shrunk = np.tan(np.radians(20)) / np.tan(np.radians(30)) - 1  # in the wider image before, all was nearer to the middle
    np.testing.assert_allclose(flow[1], np.stack([(u - 16) * shrunk, (v - 12) * shrunk], -1), atol=1e-4)


def test_orthographic_rays_are_parallel():
    camera = mjs.CameraSensorCfg(name="map", pos=(0, 0, 3), fovy=4.0, orthographic=True, width=4, height=4, data_types=("depth",))
    s = scene(camera)
    mjs.Simulation(s)
    # Pixel centres at x = -1.5, -0.5, 0.5, 1.5 m; the box covers x in [0.5, 1.5], y in [-0.5, 0.5].
    depth = s["map"].data.depth[0, :, :, 0]
    assert set(np.round(depth, 4).ravel()) <= {3.0, 2.5}
    np.testing.assert_allclose(depth[:, :2], 3.0, atol=1e-4)


def test_clone_data():
    copied = mjs.CameraSensorCfg(name="a", camera_name="room/eye", width=4, height=4, clone_data=True)
    shared = mjs.CameraSensorCfg(name="b", pos=(0, 0, 3), width=4, height=4)
    s = scene(copied, shared)
    mjs.Simulation(s)
    assert not np.shares_memory(s["a"].data.rgb, s["a"].data.rgb)
    assert np.shares_memory(s["b"].data.rgb, s["b"].data.rgb)


def test_rays():
    s = scene(
        mjs.RayCastSensorCfg(name="scan", frame=mjs.ObjRef("body", "head", "room"), pattern=mjs.GridPatternCfg(size=(2, 0), resolution=1)),
        mjs.TerrainHeightSensorCfg(name="height", frame=mjs.ObjRef("body", "head", "room"), reduction="none",
                                   pattern=mjs.UserPatternCfg(offsets=((0, 0, 0), (1, 0, 0)))),
    )  # fmt: skip
    mjs.Simulation(s, num_worlds=2)
    np.testing.assert_allclose(s["scan"].data.distances[0], [4, 4, 3.5], atol=1e-5)
    assert (s["scan"].num_rays, s["scan"].num_frames, s["scan"].num_rays_per_frame) == (3, 1, 3)
    np.testing.assert_allclose(s["height"].data.heights[1, 0], [4, 3.5], atol=1e-5)
    assert s["scan"].cfg.max_distance == 10
    np.testing.assert_allclose(mjs.observations.height_scan(_env(s), "scan")[0], [4, 4, 3.5], atol=1e-5)


def _env(s):
    return type("Env", (), {"scene": s})


def test_camera_errors():
    for kwargs, text in [
        (dict(data_types=("rgbd",)), "rgb"),
        (dict(width=0), "width"),
        (dict(data_types="depths"), "depth"),
    ]:
        with pytest.raises((ValueError, KeyError), match=text):
            mjs.CameraSensorCfg(name="c", **kwargs)
    with pytest.raises((ValueError, KeyError), match="room/eye"):
        scene(mjs.CameraSensorCfg(name="c", camera_name="room/ey"))


def test_orthographic_highlights_equal_opengl():
    kwargs = dict(camera_name="room/eye", width=60, height=40, orthographic=True, fovy=4.0)
    s = scene(mjs.CameraSensorCfg("rays", **kwargs), mjs.CameraSensorCfg("opengl", renderer="opengl", **kwargs))
    try:
        mjs.Simulation(s)
    except RuntimeError as error:
        pytest.skip(str(error))
    difference = s["rays"].data.rgb.astype(float) - s["opengl"].data.rgb
    assert np.abs(difference).mean() < 1


MARKED = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="3 3 .1"/>
    <site name="anchor" pos="-.5 0 1" size=".02"/>
    <body name="ball" pos=".4 0 .6"><joint type="slide" axis="0 1 0"/><geom size=".1" mass="1"/>
      <site name="goal" pos="0 0 .2" size=".12" rgba="0 1 0 1"/></body>
    <camera name="eye" pos="0 -2.5 1.2" xyaxes="1 0 0 0 .3 1"/>
  </worldbody>
  <tendon><spatial name="rope" width=".01"><site site="anchor"/><site site="goal"/></spatial></tendon>
</mujoco>
"""


def marked(renderer="rays", groups=(0,), num_worlds=1):
    types = ("rgb", "depth", "segmentation", "body_segmentation", "entity_segmentation", "flow")
    camera = mjs.CameraSensorCfg("eye", camera_name="room/eye", width=80, height=60, data_types=types, renderer=renderer, use_shadows=True,
                                 enabled_site_groups=groups, enabled_tendon_groups=groups)  # fmt: skip
    s = mjs.Scene(mjs.SceneCfg(entities={"room": mjs.EntityCfg(model=MARKED)}, sensors=(camera,)))
    try:
        return s, mjs.Simulation(s, num_worlds=num_worlds)
    except RuntimeError as error:
        if renderer == "opengl":
            pytest.skip(str(error))
        raise


SITE, TENDON = int(mujoco.mjtObj.mjOBJ_SITE), int(mujoco.mjtObj.mjOBJ_TENDON)


@pytest.mark.parametrize("renderer", ["rays", "opengl"])
def test_sites_and_tendons_move_with_their_world(renderer):
    s, sim = marked(renderer, num_worlds=3)
    for _ in range(3):  # three times, so that cached images of resting geoms are used
        s["eye"].data.rgb
        sim.forward()
    for world in range(3):
        sim.qpos[world, 0] = 0.3 * world
    sim.forward()
    many = {name: array.copy() for name, array in s["eye"].fields.items()}
    kinds = many["segmentation"][..., 1]
    assert (kinds == SITE).sum((1, 2)).min() > 20 and (kinds == TENDON).sum((1, 2)).min() > 10
    assert len({many["segmentation"][world].tobytes() for world in range(3)}) == 3
    for world in range(3):  # the image equals that of a single world
        one, alone = marked(renderer)
        alone.qpos[0, 0] = 0.3 * world
        alone.forward()
        for name, array in one["eye"].fields.items():
            if name != "flow":
                np.testing.assert_array_equal(array[0], many[name][world], err_msg=name)


def test_sites_and_tendons_belong_to_their_entity():
    s, _ = marked()
    data = s["eye"].data
    kinds = data.segmentation[0, ..., 1]
    assert (data.entity_segmentation[0, ..., 0][kinds == TENDON] == 0).all()
    assert (data.body_segmentation[0, ..., 0][kinds == TENDON] == -1).all()
    goal = (kinds == SITE) & (data.segmentation[0, ..., 0] == 1)
    assert goal.sum() > 20 and (data.body_segmentation[0, ..., 0][goal] == s.model.site_bodyid[1]).all()


def test_flow_of_a_site_equals_that_of_its_body():
    s, sim = marked()
    s["eye"].data.flow
    sim.qpos[0, 0] = 0.1
    sim.forward()
    data = s["eye"].data
    kinds, flow = data.segmentation[0, ..., 1], data.flow[0]
    goal = (kinds == SITE) & (data.segmentation[0, ..., 0] == 1)
    assert np.isfinite(flow[goal]).all() and (np.abs(flow[goal]) > 0).any()
    assert np.isnan(flow[kinds == TENDON]).all()


def test_a_site_may_look_different_in_each_world():
    s, sim = marked(num_worlds=2)
    colors, groups = np.array([s.model.site_rgba] * 2), np.array([s.model.site_group] * 2)
    colors[1, 1], groups[0, 0] = (1, 0, 0, 1), 4
    sim.randomize("site_rgba", colors)
    sim.randomize("site_group", groups)
    rgb, seen = s["eye"].data.rgb, s["eye"].data.segmentation
    goal = (seen[..., 1] == SITE) & (seen[..., 0] == 1)
    assert rgb[0][goal[0]].mean(0).argmax() == 1 and rgb[1][goal[1]].mean(0).argmax() == 0
    anchors = ((seen[..., 1] == SITE) & (seen[..., 0] == 0)).sum((1, 2))
    assert anchors[0] == 0 < anchors[1]
