# SPDX-License-Identifier: Apache-2.0
"""mjsense.Renderer: its interface, its images against truth and against mujoco.Renderer, threads and processes."""

import concurrent.futures
import gc
import multiprocessing
import os
import resource

import numpy as np
import pytest
from test_fork import in_fork

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")

BALL = """<mujoco><visual><map znear="0.01" zfar="50"/></visual><statistic extent="1" center="0 0 0"/>
<worldbody><light pos="0 0 3" castshadow="false"/>
<camera name="front" pos="0 -2.5 0" xyaxes="1 0 0 0 0 1" fovy="45"/><camera name="frontal" pos="0 -3 0" xyaxes="1 0 0 0 0 1"/>
<body name="ball" pos="0 0 0"><freejoint/><geom name="ball" size="0.5" rgba="1 0 0 1"/></body></worldbody></mujoco>"""

SHAPES = """<mujoco><visual><map znear="0.01" zfar="30"/></visual><statistic extent="2" center="0 0 .4"/>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 .2" width="64" height="384"/>
<texture name="checks" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .7 .6" width="128" height="128"/>
<texture name="cube" type="cube" builtin="checker" mark="cross" markrgb="1 1 1" rgb1=".7 .2 .2" rgb2=".2 .2 .7" width="64" height="64"/>
<material name="floor" texture="checks" texrepeat="4 4" texuniform="true" reflectance=".2"/>
<material name="box" texture="cube"/><material name="flat" texture="checks" texrepeat="2 2"/><material name="glass" rgba=".2 .8 .9 .4"/>
<mesh name="rock" vertex="0 0 0  .3 0 0  0 .3 0  0 0 .3  .25 .25 .1"/>
<hfield name="hill" nrow="3" ncol="3" size=".4 .4 .2 .05" elevation="0 1 0 2 3 1 0 1 0"/></asset>
<worldbody><light pos="1 -1 3" dir="-.3 .3 -1" diffuse=".7 .7 .7"/>
<light type="directional" dir=".5 .5 -1" pos="0 0 3" diffuse=".3 .3 .3" castshadow="false"/>
<camera name="view" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85"/><camera name="below" pos="1.6 -1.6 -.5" xyaxes="1 1 0 .2 -.2 1"/>
<camera name="flat" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85" projection="orthographic" fovy="2"/>
<camera name="sensor" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85" sensorsize=".01 .008" focal=".01 .01" principal=".001 .0005"
 resolution="640 480"/>
<geom name="floor" type="plane" size="0 0 .1" material="floor"/><geom type="plane" size=".3 .2 .1" pos="-.8 .8 .3" euler="40 0 20" material="flat"/>
<geom type="hfield" hfield="hill" pos="-.8 -.4 .02" rgba=".3 .7 .3 1"/>
<body pos="0 0 .5"><freejoint/><geom type="sphere" size=".15" material="flat"/></body>
<body name="arm" pos=".5 0 .3"><joint type="hinge" axis="0 1 0"/><geom type="capsule" size=".08 .2" rgba=".9 .4 .2 1"/>
 <site name="a" pos="0 0 .35" size=".05"/><body pos="0 0 .4"><joint type="hinge" axis="1 0 0"/><geom type="box" size=".1 .06 .08" material="box"/>
 <site name="b" type="box" size=".04 .02 .06" pos="0 0 .12" rgba="0 1 0 .5"/></body></body>
<body pos="0 .6 .3"><joint type="slide" axis="0 0 1"/><geom type="cylinder" size=".1 .2" material="flat"/><site name="c" pos="0 0 .3"/></body>
<body pos="-.4 .1 .3"><joint type="ball"/><geom type="ellipsoid" size=".1 .15 .2" rgba=".6 .2 .8 1"/></body>
<body pos=".4 -.6 .1"><freejoint/><geom type="mesh" mesh="rock" rgba=".9 .9 .3 1"/></body>
<body pos="-.2 -.6 .2"><freejoint/><geom type="box" size=".15 .15 .15" material="glass"/></body></worldbody>
<tendon><spatial width=".01" rgba="1 0 0 1"><site site="a"/><site site="b"/><site site="c"/></spatial></tendon></mujoco>"""

SOFT = """<mujoco><statistic extent="1" center="0 0 .3"/><worldbody><light pos="0 -1 2" dir="0 .5 -1"/>
<camera name="view" pos="0 -1.6 .9" xyaxes="1 0 0 0 .4 .9"/><geom type="plane" size="1 1 .1"/>
<flexcomp name="cloth" type="grid" dim="2" count="6 6 1" spacing=".08 .08 .08" pos="-.3 0 .4" radius=".01" rgba=".2 .6 .9 1" mass=".1"/>
<flexcomp name="gel" type="grid" dim="3" count="4 4 4" spacing=".07 .07 .07" pos=".3 0 .3" radius=".01" rgba=".9 .5 .2 1" mass=".1"/>
<flexcomp name="rope" type="grid" dim="1" count="8 1 1" spacing=".05 .05 .05" pos="0 -.3 .3" radius=".01" rgba=".3 .9 .3 1" mass=".1"/>
</worldbody></mujoco>"""


def load(xml, steps=0):
    if not hasattr(mujoco.MjModel, "cam_projection"):  # older versions
        xml = xml.replace('projection="orthographic"', 'orthographic="true"')
    if not hasattr(mujoco.MjModel, "light_type"):
        xml = xml.replace('type="directional"', 'directional="true"')
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    for _ in range(steps):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return model, data


def image_of(model, data, camera=-1, option=None, **kwargs):
    with mjs.Renderer(model, 60, 80, **kwargs) as renderer:
        renderer.update_scene(data, camera, option)
        return renderer.render()


def test_depth_of_a_ball_is_that_of_the_sphere():
    # camera |----- 2.5 m -----( centre, radius 0.5 m )
    model, data = load(BALL)
    with mjs.Renderer(model, 101, 101) as renderer:
        renderer.update_scene(data, "front")
        images = renderer.render_images()
        renderer.enable_depth_rendering()
        np.testing.assert_array_equal(renderer.render(), images["depth"])
        renderer.enable_segmentation_rendering()
        np.testing.assert_array_equal(renderer.render(), images["segmentation"])
        renderer.disable_segmentation_rendering()
        np.testing.assert_array_equal(renderer.render(), images["rgb"])
    pixel = 2 * np.tan(np.radians(22.5)) / 101
    x = (np.arange(101) - 50) * pixel
    square = x[None] ** 2 + x[:, None] ** 2
    inside = 2.5**2 - (1 + square) * (2.5**2 - 0.5**2)
    expected = np.where(inside > 0, (2.5 - np.sqrt(np.maximum(inside, 0))) / (1 + square), 50)
    sure = np.abs(inside) > 1e-3
    np.testing.assert_allclose(images["depth"][sure], expected[sure], rtol=2e-4)
    assert images["depth"][50, 50] == pytest.approx(2, abs=1e-6)
    geom = model.geom("ball").id
    np.testing.assert_array_equal(images["segmentation"][sure, 0], np.where(inside > 0, geom, -1)[sure])
    np.testing.assert_array_equal(images["segmentation"][sure, 1], np.where(inside > 0, int(mujoco.mjtObj.mjOBJ_GEOM), -1)[sure])
    red, green, blue = images["rgb"][50, 50]
    assert red > 100 and green == blue < red
    assert not images["rgb"][0, 0].any()


def test_properties_and_defaults():
    model, data = load(BALL)
    renderer = mjs.Renderer(model)
    assert (renderer.height, renderer.width, renderer.model) == (240, 320, model)
    assert isinstance(renderer.scene, mujoco.MjvScene)
    assert renderer.scene.maxgeom == 10000
    renderer.update_scene(data)
    image = renderer.render()
    assert image.shape == (240, 320, 3)
    assert image.dtype == np.uint8
    large = mjs.Renderer(model, 700, 900)  # more than offheight and offwidth
    large.update_scene(data)
    assert large.render().shape == (700, 900, 3)


def test_out():
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    renderer.update_scene(data, "front")
    image = renderer.render()
    out = np.zeros((20, 30, 3), np.uint8)
    assert renderer.render(out=out) is out
    np.testing.assert_array_equal(out, image)
    for other in (np.zeros((20, 30, 3), np.float32), np.zeros((20, 60, 3), np.uint8)[:, ::2]):
        assert renderer.render(out=other) is other
        np.testing.assert_array_equal(other, image)
    with pytest.raises(
        ValueError, match=r"Expected `out.shape == \(20, 30, 3\)` for rgb rendering. Got `out.shape=\(30, 20, 3\)`"
    ):
        renderer.render(out=np.zeros((30, 20, 3), np.uint8))


def test_errors():
    model, data = load(BALL)
    with pytest.raises(ValueError, match="height must be at least 1, got 0"):
        mjs.Renderer(model, 0, 10)
    with pytest.raises(TypeError, match=r"model must be a mujoco\.MjModel, not .*MjData"):
        mjs.Renderer(data)
    renderer = mjs.Renderer(model, 20, 30)
    with pytest.raises(ValueError, match=r'The camera "fornt" does not exist. Nearest: front, frontal'):
        renderer.update_scene(data, "fornt")
    with pytest.raises(ValueError, match=r"The camera id 2 is out of range \[-1, 2\)"):
        renderer.update_scene(data, 2)
    _, other = load(SHAPES)
    with pytest.raises(ValueError, match=r"`data` belongs to another model: nq is .*, but the renderer's model had 7"):
        renderer.update_scene(other)
    with pytest.raises(ValueError, match="call update_scene"):
        renderer.render()
    with pytest.raises(ValueError, match="unknown kind of image 'normals'; expected one of rgb, depth, segmentation"):
        renderer.render_images(("normals",))
    renderer.close()
    renderer.close()
    for call in (
        renderer.render,
        lambda: renderer.update_scene(data),
        renderer.render_images,
        lambda: renderer.render_batch([data]),
    ):
        with pytest.raises(RuntimeError, match="used after close"):
            call()


def test_images_do_not_depend_on_the_number_of_images_before():
    vertices = np.random.default_rng(0).normal(size=(200, 3))
    vertices *= 0.4 / np.linalg.norm(vertices, axis=1, keepdims=True)
    model, data = load(f"""<mujoco><asset><mesh name="rock" vertex="{" ".join(map(str, vertices.ravel()))}"/></asset><worldbody>
        <light pos="1 0 3" dir="-.3 0 -1" castshadow="true"/><geom type="plane" size="2 2 .1"/>
        <geom type="mesh" mesh="rock" pos="0 0 .5"/><geom type="box" size=".1 .5 .1" pos="0 0 1.1"/></worldbody></mujoco>""")
    with mjs.Renderer(model, 60, 80) as renderer:
        renderer.update_scene(data)
        first = renderer.render()
        for _ in range(60):  # its mesh gets a better tree for shadow rays
            assert np.array_equal(renderer.render(), first)


def test_data_of_a_model_that_was_compiled_anew_is_refused():
    spec = mujoco.MjSpec.from_string(BALL)
    model = spec.compile()
    data = mujoco.MjData(model)
    renderer = mjs.Renderer(model, 20, 30)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    _, changed = spec.recompile(model, data)
    for call in (lambda: renderer.update_scene(changed, "front"), lambda: renderer.render_batch([changed], "front")):
        with pytest.raises(ValueError, match="`data` belongs to another model: ngeom is 2, but the renderer's model had 1"):
            call()


def test_a_pose_that_is_not_finite_is_named():
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    data.geom_xpos[0, 1] = np.nan
    renderer.update_scene(data, "front")
    with pytest.raises(ValueError, match=r"geom 0 of the scene \(geom 'ball', id 0\) has a pose or size that is not finite"):
        renderer.render()


REFUSED = ("WIREFRAME", "ADDITIVE", "DEPTH", "SEGMENT", "IDCOLOR", "CULL_FACE")


@pytest.mark.parametrize("flag", REFUSED)
def test_flags_without_support_are_refused(flag):
    if not hasattr(mujoco.mjtRndFlag, f"mjRND_{flag}"):
        pytest.skip(f"MuJoCo {mujoco.__version__} has no mjRND_{flag}")
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    renderer.update_scene(data)
    index = getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")
    value = renderer.scene.flags[index] = 1 - renderer.scene.flags[index]
    with pytest.raises(ValueError, match=rf"scene.flags\[mjRND_{flag}\] = {value} is not supported"):
        renderer.render()


@pytest.mark.parametrize("name", ["stereo", "enabletransform", "framewidth"])
def test_settings_of_the_scene_without_support_are_refused(name):
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    renderer.update_scene(data)
    setattr(renderer.scene, name, 1)
    with pytest.raises(ValueError, match=f"scene.{name} = (1|True) is not supported"):
        renderer.render()


def test_labels_are_refused():
    model, data = load(BALL)
    option = mujoco.MjvOption()
    option.label = mujoco.mjtLabel.mjLABEL_BODY
    with pytest.raises(ValueError, match="has a label, and labels are not drawn"):
        image_of(model, data, "front", option)


def test_edits_of_the_model_show_in_the_next_image():
    model, data = load(SHAPES)
    renderer = mjs.Renderer(model, 60, 80)

    def look():
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, "view")
        return renderer.render()

    images = [look()]
    edits = [
        lambda: model.geom_rgba.__setitem__((3, slice(3)), (0, 1, 0)),
        lambda: model.geom_size.__setitem__((4, 0), 0.15),
        lambda: model.light_diffuse.__imul__(0.5),
        lambda: model.mat_rgba.__setitem__((0, slice(3)), (1, 0, 0)),
        lambda: model.tex_data.__imul__(0),
        lambda: model.hfield_data.__setitem__(4, 0.2),
        lambda: data.qpos.__setitem__(2, 0.7),
        lambda: model.mesh_vert.__imul__(1.5),
    ]
    for i, edit in enumerate(edits):
        edit()
        images.append(look())
        assert (images[-1] != images[-2]).any(), f"edit {i} does not show"
        np.testing.assert_array_equal(look(), images[-1])
    np.testing.assert_array_equal(image_of(model, data, "view"), images[-1])


def test_reload_shows_a_small_change():
    model, data = load(SHAPES)
    renderer = mjs.Renderer(model, 60, 80)
    renderer.update_scene(data, "view")
    before = renderer.render()
    size = model.tex_height[2] * model.tex_width[2] * 3
    checks = model.tex_data[model.tex_adr[2] :][:size]
    checks[1 : size // 2 : 3] = 255
    renderer.reload()
    assert (renderer.render() != before).any()


def test_decoration_geoms_are_drawn_and_not_segmented():
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 60, 80)
    renderer.update_scene(data, "front")
    before = renderer.render_images()
    for shape in ("SPHERE", "BOX", "CAPSULE", "ARROW", "ARROW1", "ARROW2", "LINE", "LINEBOX", "TRIANGLE"):
        renderer.update_scene(data, "front")
        scene = renderer.scene
        geom = scene.geoms[scene.ngeom]
        kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape}")
        mujoco.mjv_initGeom(
            geom,
            kind,
            np.full(3, 0.1),
            np.array([0.0, -0.8, 0.0]),
            np.array([1.0, 0, 0, 0, 0, -1, 0, 1, 0]),
            np.array([0, 0, 1, 1], np.float32),
        )
        if shape in ("CAPSULE", "ARROW", "ARROW1", "ARROW2", "LINE"):
            mujoco.mjv_connector(
                geom, kind, 3 if shape == "LINE" else 0.05, np.array([-0.3, -0.8, 0]), np.array([0.3, -0.8, 0.1])
            )
        geom.segid = -1
        scene.ngeom += 1
        after = renderer.render_images()
        blue = (after["rgb"][..., 2] > after["rgb"][..., 0]).sum()
        assert blue > (8 if shape in ("LINE", "LINEBOX", "TRIANGLE") else 40), shape
        np.testing.assert_array_equal(after["depth"], before["depth"])
        np.testing.assert_array_equal(after["segmentation"], before["segmentation"])


def test_a_negative_alpha_hides_a_site():
    model, data = load(SHAPES)
    model.light_castshadow[:] = 0  # hidden sites cast shadows
    visible = image_of(model, data, "view")
    model.site_rgba[:, 3] = 0
    hidden = image_of(model, data, "view")
    assert (visible != hidden).any()
    model.site_rgba[:, 3] = -0.5
    np.testing.assert_array_equal(image_of(model, data, "view"), hidden)


def test_groups_and_free_and_tracking_cameras():
    model, data = load(SHAPES)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    option.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = 0
    assert (image_of(model, data, "view") != image_of(model, data, "view", option)).any()
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    np.testing.assert_array_equal(image_of(model, data, camera), image_of(model, data))
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = model.body("arm").id
    renderer = mjs.Renderer(model, 60, 80)
    renderer.update_scene(data, camera)
    assert (renderer.render() != image_of(model, data)).any()


def test_a_batch_equals_single_images():
    model, _ = load(SHAPES)
    datas = []
    for seed in range(7):
        data = mujoco.MjData(model)
        data.qpos[:] += 0.1 * np.random.default_rng(seed).normal(size=model.nq)
        mujoco.mj_forward(model, data)
        datas.append(data)
    cameras = ["view", "below", 2, -1, "view", "sensor", "view"]
    with mjs.Renderer(model, 60, 80) as renderer:
        images = renderer.render_batch(datas, cameras)
        assert images.shape == (7, 60, 80, 3)
        for image, data, camera in zip(images, datas, cameras, strict=True):
            renderer.update_scene(data, camera)
            np.testing.assert_array_equal(image, renderer.render())
        out = np.empty_like(images)
        assert renderer.render_batch(datas, cameras, out=out) is out
        np.testing.assert_array_equal(out, images)
        with pytest.raises(ValueError, match="got 2 cameras for 7 datas"):
            renderer.render_batch(datas, ["view", "view"])
        with pytest.raises(ValueError, match=r"uint8 array of shape \(7, 60, 80, 3\)"):
            renderer.render_batch(datas, out=np.empty((7, 60, 80), np.uint8))


def test_threads():
    model, data = load(SHAPES)
    expected = image_of(model, data, "view")
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for image in pool.map(lambda _: image_of(model, data, "view"), range(12)):
            np.testing.assert_array_equal(image, expected)


def child_image():
    return image_of(*load(SHAPES), "view")


def test_processes():
    model, data = load(SHAPES)
    renderer = mjs.Renderer(model, 60, 80)
    renderer.update_scene(data, "view")
    expected = renderer.render()
    renderer.render_batch([data, data], "view")
    np.testing.assert_array_equal(in_fork(renderer.render), expected)
    np.testing.assert_array_equal(in_fork(lambda: renderer.render_batch([data], "view"))[0], expected)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        np.testing.assert_array_equal(pool.apply(child_image), expected)


class Images:
    """A data set whose workers draw its images."""

    def __len__(self):
        return 4

    def __getitem__(self, index):
        return child_image()


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_dataloader_workers(context):
    data = pytest.importorskip("torch.utils.data")
    expected = child_image()
    loader = data.DataLoader(Images(), batch_size=2, num_workers=2, multiprocessing_context=context)
    for batch in loader:
        for image in batch.numpy():
            np.testing.assert_array_equal(image, expected)


def test_images_of_another_size_are_those_of_a_renderer_of_that_size():
    model, data = load(SHAPES, 20)
    with mjs.Renderer(model, 60, 80) as renderer, mjs.Renderer(model, 33, 47) as other:
        for each in (renderer, other):
            each.update_scene(data, "view")
        found = renderer.render_images(height=33, width=47)
        for kind, image in other.render_images().items():
            np.testing.assert_array_equal(found[kind], image)
        assert renderer.render().shape == (60, 80, 3)
        with pytest.raises(ValueError, match="width must be at least 1, got 0"):
            renderer.render_images(("rgb",), width=0)


def test_a_scene_whose_class_has_only_the_geoms_in_use_is_drawn():
    class Scene(mujoco.MjvScene):  # as dm_control's
        @property
        def geoms(self):
            return super().geoms[: self.ngeom]

    model, data = load(BALL)
    scene, camera = Scene(model, 100), mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
    renderer = mjs.Renderer.of_scene(model, scene, 60, 80)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    np.testing.assert_array_equal(renderer.render(), image_of(model, data, 0))


def test_renderers_leak_nothing():
    model, data = load(SHAPES)

    def use():
        with mjs.Renderer(model, 16, 16, max_geom=100) as renderer:
            renderer.update_scene(data, "view")
            renderer.render()

    for _ in range(100):
        use()
    gc.collect()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    files = len(os.listdir("/proc/self/fd"))
    for _ in range(1000):
        use()
    gc.collect()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 8000  # KiB
    assert len(os.listdir("/proc/self/fd")) == files


# Against MuJoCo's own renderer


@pytest.fixture(scope="module")
def opengl():
    os.environ.setdefault("MUJOCO_GL", "egl")
    pytest.importorskip("OpenGL")
    model, _ = load(BALL)
    try:
        mujoco.Renderer(model, 8, 8).close()
    except Exception as error:
        pytest.skip(f"mujoco.Renderer does not work here: {error}")


def both(model, data, camera, option=None):
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 240, 320) as renderer:
            for _ in range(2):  # MuJoCo's first image has infinite planes at another place than the following ones
                renderer.update_scene(data, camera, option)
            row = [renderer.render()]
            renderer.enable_depth_rendering()
            row.append(renderer.render())
            renderer.enable_segmentation_rendering()
            row.append(renderer.render())
            images.append(row)
    return list(zip(*images, strict=True))


def compare(images, psnr):
    rgb, depth, segmentation = images
    error = np.mean((rgb[0].astype(float) - rgb[1]) ** 2)
    assert 10 * np.log10(255**2 / max(error, 1e-9)) > psnr
    assert np.median(np.abs(depth[0] - depth[1])) < 1e-5
    assert np.quantile(np.abs(depth[0] - depth[1]), 0.98) < 5e-3
    assert (segmentation[0] == segmentation[1]).all(-1).mean() > 0.998


@pytest.mark.parametrize("camera", ["view", "below", "flat", "sensor", -1])
def test_shapes_look_as_in_opengl(opengl, camera):
    images = both(*load(SHAPES, 60), camera)
    if camera == "flat" and mujoco.__version__ < "4":  # whose depth of orthographic cameras is wrong
        images[1] = (images[1][1],) * 2
    compare(images, 34)


@pytest.mark.parametrize(
    "flag", [i for i in range(int(mujoco.mjtRndFlag.mjNRNDFLAG)) if mujoco.mjtRndFlag(i).name[6:] not in REFUSED]
)
def test_all_other_flags_of_the_scene_do_what_they_do_in_opengl(opengl, flag):
    model, data = load(SHAPES, 60)
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 240, 320) as renderer:
            for _ in range(2):
                renderer.update_scene(data, "view")
            renderer.scene.flags[flag] = 1 - renderer.scene.flags[flag]
            images.append(renderer.render().astype(float))
    assert 10 * np.log10(255**2 / np.mean((images[0] - images[1]) ** 2)) > 34


@pytest.mark.parametrize(("tilt", "fog", "haze"), [(1, (0.3, 1.5), 0.3), (0.2, (5, 40), 0.8)], ids=["surfaces", "sky and haze"])
def test_fog_is_that_of_opengl(opengl, tilt, fog, haze):
    model, data = (
        load(f"""<mujoco><visual><map zfar="30" fogstart="{fog[0]}" fogend="{fog[1]}" haze="{haze}"/><rgba fog=".9 .2 .5 1"/></visual>
        <statistic extent="2" center="0 0 .4"/><asset><material name="floor" reflectance=".4"/>
        <texture type="skybox" builtin="gradient" rgb1=".2 .6 .8" rgb2="0 0 .2" width="64" height="384"/></asset>
        <worldbody><light pos="0 0 6"/><camera name="view" pos="0 -2 2.5" xyaxes="1 0 0 0 {tilt} 1"/><geom type="plane" size="0 0 .1" material="floor"/>
        <geom size=".3" pos="0 0 .4" rgba="0 1 0 1"/><geom type="box" size=".2 .02 .2" pos="-.5 -.6 .5" rgba="1 1 0 .5"/></worldbody></mujoco>""")
    )
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 120, 160) as renderer:
            for _ in range(2):
                renderer.update_scene(data, "view")
            without = renderer.render()
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
            images.append(renderer.render().astype(float))
            assert (np.abs(images[-1] - without).max(-1) > 10).mean() > 0.3
    assert 10 * np.log10(255**2 / np.mean((images[0] - images[1]) ** 2)) > 40


@pytest.mark.parametrize("flag", range(int(mujoco.mjtVisFlag.mjNVISFLAG)))
def test_visual_flags_do_what_they_do_in_opengl(opengl, flag):
    option = mujoco.MjvOption()
    option.flags[flag] = not option.flags[flag]
    model, data = load(SHAPES, 60)
    rgb, _, _ = both(model, data, "view", option)
    error = np.mean((rgb[0].astype(float) - rgb[1]) ** 2)
    assert 10 * np.log10(255**2 / error) > 31.5


@pytest.mark.parametrize(
    ("light", "region"),
    [('type="directional"', 'shadowclip=".4"'), ('type="spot" cutoff="40" exponent="1"', 'shadowscale=".4"')],
    ids=["directional", "spot"],
)
def test_shadows_end_where_they_end_in_opengl(opengl, light, region):
    boxes = "".join(
        f'<geom type="box" size=".05 .05 .2" pos="{0.3 * x} {0.3 * y} .3"/>' for x in range(-5, 6) for y in range(-5, 6)
    )
    model, data = (
        load(f"""<mujoco><visual><map {region}/><headlight diffuse=".2 .2 .2"/></visual><statistic extent="2" center="0 0 0"/>
        <worldbody><light pos=".2 0 2" dir=".2 .1 -1" {light}/><camera pos="0 -2 2.5" xyaxes="1 0 0 0 .8 .6"/>
        <geom type="plane" size="3 3 .1"/>{boxes}</worldbody></mujoco>""")
    )
    compare(both(model, data, 0), 30)


@pytest.mark.parametrize("light", ['type="directional"', 'type="spot" cutoff="60"'], ids=["directional", "spot"])
@pytest.mark.parametrize("distance", [0.05, 0.15, -0.05])
def test_geoms_near_a_light_cast_shadows_as_in_opengl(opengl, light, distance):
    # light (o) above a box (=), above the floor; the near plane of the light's shadow map is 0.1 m below it
    model, data = (
        load(f"""<mujoco><visual><map znear=".05"/><headlight diffuse=".1 .1 .1"/></visual><statistic extent="2" center="0 0 0"/>
        <worldbody><light pos="0 0 1" dir="0 0 -1" {light}/><camera pos="0 -1 1" xyaxes="1 0 0 0 .7 .7"/>
        <geom type="plane" size="2 2 .1"/><geom type="box" size=".2 .2 .005" pos="0 0 {1 - distance}"/></worldbody></mujoco>""")
    )
    theirs, ours = both(model, data, 0)[0]
    assert 10 * np.log10(255**2 / np.mean((theirs.astype(float) - ours) ** 2)) > 30


@pytest.mark.parametrize(("repeat", "uniform"), [(1, "true"), (3, "false"), (3, "true")])
def test_textured_meshes_look_as_in_opengl(opengl, repeat, uniform):
    model, data = (
        load(f"""<mujoco><asset><texture name="t" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
        <material name="m" texture="t" texrepeat="{repeat} {repeat}" texuniform="{uniform}"/>
        <mesh name="prism" vertex="0 0 0  1 0 0  0 1 0  0 0 -1  1 0 -1  0 1 -1" texcoord="0 0  1 0  0 1  .5 .5  1 .5  .5 1"
         face="0 1 2  3 5 4  0 4 1  0 3 4  1 4 5  1 5 2  0 2 5  0 5 3"/></asset>
        <worldbody><light pos="0 0 3" castshadow="false"/><camera name="view" pos="0 0 3"/><geom type="mesh" mesh="prism" material="m"/></worldbody></mujoco>""")
    )
    compare(both(model, data, "view"), 31)


@pytest.mark.parametrize("skin", [0, 1])
def test_flexes_look_as_in_opengl(opengl, skin):
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_FLEXSKIN] = skin
    option.flags[mujoco.mjtVisFlag.mjVIS_FLEXVERT] = 1 - skin
    compare(both(*load(SOFT, 30), "view", option), 33)


# Gymnasium


@pytest.mark.parametrize("mode", ["rgb_array", "depth_array", "rgbd_tuple"])
def test_gymnasium_environments_render_as_with_opengl(opengl, mode):
    pytest.importorskip("glfw")  # which Gymnasium's renderer imports
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    images = []
    for adapt in (lambda env: env, use):
        env = adapt(gymnasium.make("HalfCheetah-v5", render_mode=mode, width=96, height=80))
        env.reset(seed=0)
        env.render()
        image = env.render()
        images.append(image if isinstance(image, tuple) else (image,))
    for theirs, ours in zip(*images, strict=True):
        assert theirs.shape == ours.shape
        assert theirs.dtype == ours.dtype
        if ours.dtype == np.uint8:
            assert 10 * np.log10(255**2 / np.mean((theirs.astype(float) - ours) ** 2)) > 30
        else:
            assert np.median(np.abs(theirs - ours)) < 1e-3


def cheetah():
    pytest.importorskip("glfw")  # which Gymnasium's renderer imports
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    return use(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array", width=32, height=32))


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_gymnasium_subprocesses(context):
    pytest.importorskip("glfw")
    vector = pytest.importorskip("gymnasium.vector")
    envs = vector.AsyncVectorEnv([cheetah, cheetah], context=context)
    try:
        envs.reset(seed=3)
        images = envs.render()
    finally:
        envs.close()
    env = cheetah()
    env.reset(seed=3)
    np.testing.assert_array_equal(images[0], env.render())
    assert images[1].shape == (32, 32, 3)


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_stable_baselines3_subprocesses(context):
    pytest.importorskip("glfw")
    vector = pytest.importorskip("stable_baselines3.common.vec_env")
    envs = vector.SubprocVecEnv([cheetah, cheetah], start_method=context)
    try:
        envs.seed(3)
        envs.reset()
        images = envs.get_images()
    finally:
        envs.close()
    env = cheetah()
    env.reset(seed=3)
    np.testing.assert_array_equal(images[0], env.render())


def test_gymnasium_environments_without_mujoco_are_refused():
    pytest.importorskip("glfw")  # which Gymnasium's renderer imports
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    with pytest.raises(TypeError, match="has no mujoco_renderer"):
        use(gymnasium.make("CartPole-v1"))
