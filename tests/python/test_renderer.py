# SPDX-License-Identifier: Apache-2.0
"""mjsense.Renderer: its interface, and its images against truth."""

import copy
import pickle

import numpy as np
import pytest
from renderer_scenes import BALL, SHAPES, image_of, load

import mjsense as mjs
from mjsense.sim.scene_drawer import SceneDrawer

mujoco = pytest.importorskip("mujoco")


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


def test_walls_of_a_height_field_reach_its_heights_above_one():
    # camera |----- 2 m -----[ a field of the height 2 size[2] = 1.4 m; the camera looks at 1.05 m
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><visual><map znear="0.01" zfar="50"/></visual><statistic extent="1" center="0 0 0"/>
        <asset><hfield name="h" nrow="3" ncol="3" size="1 1 .7 .1"/></asset><worldbody><light pos="0 0 3"/>
        <camera name="side" pos="0 -3 1.05" xyaxes="1 0 0 0 0 1"/><geom type="hfield" hfield="h"/></worldbody></mujoco>"""
    )
    model.hfield_data[:] = 2  # the compiler scales heights to 0..1, programs write others
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, 11, 11) as renderer:
        renderer.enable_depth_rendering()
        renderer.update_scene(data, "side")
        assert renderer.render()[5, 5] == pytest.approx(2, abs=1e-5)


def test_properties_and_defaults():
    model, data = load(BALL)
    renderer = mjs.Renderer(model)
    assert (renderer.height, renderer.width, renderer.model) == (240, 320, model)
    assert isinstance(renderer.scene, mujoco.MjvScene)
    assert renderer.scene.maxgeom == 10000
    assert (renderer.shading, renderer.environment, renderer.samples_per_pixel) == ("classic", "model", 64)
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


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda m, d: d.geom_xpos, r"geom 0 of the scene \(geom 'ball', id 0\) has a pose, size or colour that is not finite"),
        (lambda m, d: m.geom_rgba, r"geom 0 of the scene \(geom 'ball', id 0\) has a pose, size or colour that is not finite"),
        (lambda m, d: d.light_xdir, r"light 1 of the scene( \(light 'lamp', id 0\))? has a pose or colour that is not finite"),
        (lambda m, d: m.light_diffuse, r"light 1 of the scene( \(light 'lamp', id 0\))? has a pose or colour that is not finite"),
        (lambda m, d: m.vis.headlight.diffuse, r"Renderer: light 0 of the scene has a pose or colour that is not finite"),
        (lambda m, d: d.cam_xpos, r"the scene's camera \(camera 'front', id 0\) has a pose or field of view that is not finite"),
        (lambda m, d: m.cam_fovy, r"the scene's camera \(camera 'front', id 0\) has a pose or field of view that is not finite"),
    ],
)
def test_what_is_not_finite_is_named(edit, message):
    model, data = load(BALL.replace("<light", '<light name="lamp"'))
    renderer = mjs.Renderer(model, 20, 30)
    np.reshape(edit(model, data), -1)[0] = np.nan
    renderer.update_scene(data, "front")
    with pytest.raises(ValueError, match=message):
        renderer.render()


def test_a_camera_that_is_not_set_is_an_error():
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_USER
    with pytest.raises(ValueError, match="the near plane of the scene's camera is at 0"):  # otherwise MuJoCo ends the process
        renderer.update_scene(data, camera)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_renderer_cannot_be_copied(copied):
    with pytest.raises(TypeError, match="Renderer: cannot be copied or pickled; make one in each process"):
        copied(mjs.Renderer(load(BALL)[0]))


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
        lambda: model.hfield_size.__setitem__((0, 2), 0.4),
        lambda: data.qpos.__setitem__(2, 0.7),
        lambda: model.mesh_vert.__imul__(1.5),
    ]
    for i, edit in enumerate(edits):
        edit()
        images.append(look())
        assert (images[-1] != images[-2]).any(), f"edit {i} does not show"
        np.testing.assert_array_equal(look(), images[-1])
    np.testing.assert_array_equal(image_of(model, data, "view"), images[-1])


# A tetrahedron in view, one behind the camera, and a texture of 512 x 512.
FEW_MESHES = """<mujoco><visual><map znear="0.01" zfar="50"/><quality offsamples="1"/></visual><statistic extent="1" center="0 0 0"/>
<asset><texture name="noise" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .7 .6" width="512" height="512"/>
<material name="noise" texture="noise" texrepeat="1 1"/>
<mesh name="seen" vertex="-.5 .5 -.5  .5 .5 -.5  0 -.5 -.5  0 0 .5"/><mesh name="behind" vertex="-1 0 0  1 0 0  0 1 0  0 0 1"/></asset>
<worldbody><light pos="0 0 3" castshadow="false"/><camera name="front" pos="0 -2.5 0" xyaxes="1 0 0 0 0 1"/>
<camera name="back" pos="0 -2.5 0" xyaxes="-1 0 0 0 0 1"/>
<geom type="mesh" mesh="seen"/><geom type="mesh" mesh="behind" pos="0 -5 0"/>
<geom type="plane" size="1 1 .1" pos="0 0 -1" material="noise"/></worldbody></mujoco>"""


def test_only_what_an_image_shows_is_prepared():
    model, data = load(FEW_MESHES)
    renderer = mjs.Renderer(model, 32, 32)
    nothing = {"meshes": 0, "clusters": 0, "trees": 0, "surfaces": 0, "textures": 0, "levels": 0}
    assert renderer._opened().native.prepared() == nothing
    renderer.update_scene(data, "front")
    renderer.enable_depth_rendering()
    renderer.render()
    assert renderer._opened().native.prepared() == nothing | {"meshes": 2, "clusters": 1}
    renderer.disable_depth_rendering()
    renderer.render()
    prepared = renderer._opened().native.prepared()
    # No trees without shadows; of the texture's ten levels only those as coarse as the image, and one more.
    assert prepared == nothing | {"meshes": 2, "clusters": 1, "surfaces": 1, "textures": 1, "levels": prepared["levels"]}
    assert 1 <= prepared["levels"] <= 7
    renderer.update_scene(data, "back")
    renderer.render()
    assert renderer._opened().native.prepared() == prepared | {"clusters": 2, "surfaces": 2}
    model.light_castshadow[:] = 1
    renderer.update_scene(data, "front")
    renderer.render()
    assert renderer._opened().native.prepared()["trees"] >= 1


def test_parts_prepared_later_show_the_current_model():
    model, data = load(FEW_MESHES)
    with mjs.Renderer(model, 120, 120) as renderer:
        renderer.update_scene(data, "front")
        renderer.render()
        levels = renderer._opened().native.prepared()["levels"]
        model.mesh_vert[model.mesh_vertadr[1] :] *= 0.5
        model.tex_data[:] = model.tex_data[::-1] // 2
        for camera, size in (("back", 120), ("front", 120), ("front", 1200)):
            renderer.update_scene(data, camera)
            found = renderer.render_images(height=size, width=size)
            with mjs.Renderer(model, size, size) as other:
                other.update_scene(data, camera)
                for kind, image in other.render_images().items():
                    np.testing.assert_array_equal(found[kind], image)
        assert renderer._opened().native.prepared()["levels"] > levels


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


def test_a_triangle_has_the_sides_that_its_matrix_gives():
    # The first two columns of the matrix are unit vectors, and here they are not perpendicular.
    model, data = load(BALL)
    with mjs.Renderer(model, 60, 80) as renderer:
        renderer.update_scene(data, "front")
        scene = renderer.scene
        corner, sides = np.array([-0.2, -0.8, -0.1]), np.array([[1, 0, 0], [0.6, 0, 0.8]])
        geom = scene.geoms[scene.ngeom]
        matrix = np.stack([*sides, [0, -1, 0]], 1).ravel()
        kind = mujoco.mjtGeom.mjGEOM_TRIANGLE
        mujoco.mjv_initGeom(geom, kind, np.array([0.5, 0.3, 0]), corner, matrix, np.array([0, 0, 1, 1], np.float32))
        geom.segid = scene.ngeom
        geom.objid, geom.objtype = 7, mujoco.mjtObj.mjOBJ_CAMERA
        scene.ngeom += 1
        images = renderer.render_images()
    # Coordinates of the pixels along the sides; the plane is 1.7 m in front of the camera.
    pixel = 1.7 * 2 * np.tan(np.radians(22.5)) / 60
    x, z = (np.arange(80) - 39.5) * pixel - corner[0], (29.5 - np.arange(60)[:, None]) * pixel - corner[2]
    b = z / sides[1, 2]
    a = x - b * sides[1, 0]
    inside = np.minimum(np.minimum(a / 0.5, b / 0.3), 1 - a / 0.5 - b / 0.3)
    sure = np.abs(inside) > 1e-3
    np.testing.assert_array_equal((images["segmentation"] == [7, mujoco.mjtObj.mjOBJ_CAMERA]).all(-1)[sure], (inside > 0)[sure])
    assert images["rgb"][inside > 0.1, 2].min() > 100 and (inside > 0.1).sum() > 20


def test_geoms_of_the_scene_are_checked():
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30, max_geom=4)
    renderer.update_scene(data, "front")
    before = renderer.render()
    scene = renderer.scene
    mujoco.mjv_initGeom(
        scene.geoms[1], mujoco.mjtGeom.mjGEOM_FLEX, np.full(3, 0.1), np.zeros(3), np.eye(3).ravel(), np.ones(4, np.float32)
    )
    scene.geoms[1].objid = 0  # the model has no flexes
    scene.ngeom = 2
    np.testing.assert_array_equal(renderer.render(), before)
    scene.ngeom = 5
    with pytest.raises(ValueError, match=r"scene.ngeom is 5: must be in \[0, 4\]"):
        renderer.render()


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
        datas[3].geom_xpos[5] = np.nan
        with pytest.raises(ValueError, match=r"not finite \(datas\[3\]\)"):
            renderer.render_batch(datas, cameras)


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


POINT = """<mujoco><visual><headlight {head}/><quality shadowsize="0" offsamples="0"/></visual><statistic extent="2" center="0 0 0"/>
<asset><texture name="sky" type="cube" builtin="flat" width="8" height="8"/></asset><worldbody>{light}<camera name="view" pos="0 -1.5 1.5" xyaxes="1 0 0 0 .7 .7"/><geom type="plane" size="2 2 .1"/><geom size=".2" pos=".3 0 .3"/></worldbody></mujoco>"""
OFF = 'ambient="0 0 0" diffuse="0 0 0" specular="0 0 0"'


def point_lit(light, head=OFF, version=None, drawn=False):
    model, data = load(POINT.format(head=head, light=light))
    with mjs.Renderer(model, 60, 80) as renderer:
        if version:
            renderer._drawer = SceneDrawer(model, renderer.scene, version)
        renderer.point_lights = drawn
        renderer.update_scene(data, "view")
        return renderer.render()


@pytest.mark.parametrize("kind", ["point", "image"])
def test_point_and_image_lights_follow_the_version_of_mujoco(kind):
    if not hasattr(mujoco.MjModel, "light_type"):
        pytest.skip("this version has no such lights")
    sky = 'texture="sky"' if kind == "image" else ""
    light = f'<light type="{kind}" {sky} pos="0 0 1" diffuse=".7 .7 .7" specular=".3 .3 .3"/>'
    assert not point_lit(light, version=(3, 12)).any()
    at_camera = point_lit("", head='ambient="0 0 0" diffuse=".7 .7 .7" specular=".3 .3 .3"')
    np.testing.assert_array_equal(point_lit(light, version=(3, 11)), at_camera)


def test_point_lights_are_drawn_on_request():
    if not hasattr(mujoco.MjModel, "light_type"):
        pytest.skip("this version has no such lights")
    light = '<light type="point" pos="0 0 1"/>'
    drawn = point_lit(light, drawn=True)
    camera = mjs.CameraSensorCfg(name="camera", camera_name="view", width=80, height=60)
    scene = mjs.Scene(mjs.SceneCfg(base=POINT.format(head=OFF, light=light), sensors=(camera,)))
    sim = mjs.Simulation(scene)
    sim.reset()
    assert drawn.max() > 60
    assert np.abs(drawn.astype(int) - scene["camera"].data.rgb[0]).max() <= 2
    sim.close()
