# SPDX-License-Identifier: Apache-2.0
"""Images of mujoco_warp.render() with mjsense.compat.mujoco_warp.use() against mujoco_warp's own, in the same render contexts.

python mujoco_warp_images.py
"""

import inspect
import sys
import time

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

wp.config.log_level = 40
wp.set_device("cpu")
import mjsense.compat.mujoco_warp as compat

WORLDS, SIZES = 3, ((96, 64), (61, 75))
MESH = " ".join(f"{x} {y} {z}" for x in (-0.2, 0.2) for y in (-0.15, 0.1) for z in (0, 0.3)) + " 0 0 .45"
SERIES_4 = "samples_per_pixel" in inspect.signature(mjw.create_render_context).parameters
# What mujoco_warp 3.11 draws in another way: textures on primitives, smooth meshes, own colours of geoms with a material, and geoms
# that are hidden by their colour.
OF_4 = """
    <geom size=".2" pos="-1.3 1.3 .2" material="painted"/>
    <geom type="ellipsoid" size=".2 .1 .3" pos="-.9 1.5 .3" material="painted" euler="20 30 40"/>
    <geom type="cylinder" size=".15 .2" pos="-.4 1.6 .2" material="painted" euler="0 30 20"/>
    <geom type="capsule" size=".1 .2" pos="-1.2 .5 .3" material="spread" euler="40 0 20"/>
    <geom type="box" size=".2 .15 .25" pos="-1.6 .8 .25" material="spread" euler="0 0 30"/>
    <geom type="mesh" mesh="round" pos="-1.2 -.2 .3" material="red"/>
    <geom type="plane" size=".4 .3 .1" pos="1.2 -.6 .02" material="spread"/>
    <geom size=".5" pos="0 -1 .5" rgba="1 1 1 0"/>
"""
MODEL = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <visual><headlight ambient=".2 .2 .2" diffuse=".3 .35 .3" specular=".2 .2 .2"/></visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".3 .5 .7" rgb2=".9 .6 .2" width="64" height="384"/>
    <texture name="checks" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .8 .7" width="128" height="128"/>
    <material name="floor" texture="checks" texrepeat="1 1.5" texuniform="true" specular=".3"/>
    <material name="red" rgba=".8 .2 .1 .4" specular=".9" shininess=".4" emission=".1" reflectance=".5"/>
    <mesh name="hull" vertex="{MESH}"/>
    {'<mesh name="round" builtin="sphere" params="3" scale=".3 .2 .25"/>' if SERIES_4 else ""}
    <material name="painted" texture="checks" texrepeat="2 3"/>
    <material name="spread" texture="checks" texrepeat="4 6" texuniform="true" specular=".8"/>
    <hfield name="hills" nrow="12" ncol="10" size=".6 .5 .2 .05" elevation="{' '.join(str(i * 7 % 11) for i in range(120))}"/>
  </asset>
  <worldbody>
    <light type="directional" pos="0 0 4" dir=".3 .2 -1" diffuse=".4 .4 .3" specular=".3 .3 .3" ambient=".05 .02 0"/>
    <light pos="1 -2 3" dir="-.3 .5 -1" cutoff="40" exponent="5" diffuse=".6 .6 .8" attenuation=".5 .1 .05"/>
    <geom name="floor" type="plane" size="0 0 .1" material="floor"/>
    <geom name="hills" type="hfield" hfield="hills" pos="1.4 1.2 0"/>
    <geom type="box" size=".3 .2 .15" pos="-.8 .6 .15" material="red" rgba=".1 .9 .1 1"/>
    <geom type="box" size=".1 .1 .4" pos=".1 1.4 .4" rgba=".4 .4 .9 .3" group="1"/>
    <geom type="box" size=".9 .9 .9" pos="0 0 0.9" group="4"/>
    {OF_4 if SERIES_4 else ""}
    <camera name="front" pos="0 -2.4 1.4" xyaxes="1 0 0 0 .45 1" fovy="55"/>
    <camera name="side" pos="-2.3 -.6 1.1" xyaxes=".2 -1 0 .4 .1 1" focal=".02 .02" sensorsize=".03 .02" resolution="61 75"/>
    <body name="a" pos="0 0 .5"><freejoint/><geom size=".2" rgba=".9 .6 .3 1"/>
      <body pos=".4 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 .2" size=".07"/>
        <camera name="hand" pos=".2 0 .6" xyaxes="0 -1 0 1 0 0"/></body></body>
    <body name="b" pos=".8 -.2 .4"><freejoint/><geom type="cylinder" size=".12 .2" rgba=".2 .7 .7 1"/></body>
    <body name="c" pos="-.5 -.4 .4"><freejoint/><geom type="ellipsoid" size=".1 .15 .25" rgba=".7 .3 .8 1"/></body>
    <body name="d" pos=".2 .5 .2"><freejoint/><geom type="mesh" mesh="hull" rgba=".9 .9 .2 1"/></body>
  </worldbody>
</mujoco>""")
CAMERAS = ["front", "side", "hand"]


def context(**options):
    options = {"cam_res": [*SIZES, SIZES[0]], "render_rgb": True, "render_depth": [True, False, True]} | options
    return mjw.create_render_context(MODEL, nworld=WORLDS, render_seg=True, cam_active=CAMERAS, **options)


def start():
    rng = np.random.default_rng(0)
    data = mujoco.MjData(MODEL)
    mujoco.mj_forward(MODEL, data)
    model, worlds = mjw.put_model(MODEL), mjw.put_data(MODEL, data, nworld=WORLDS, nconmax=100, njmax=300)
    worlds.qpos.numpy()[:, 2] += rng.uniform(0, 0.3, WORLDS)
    worlds.qvel.numpy()[:] = rng.normal(0, 0.5, (WORLDS, MODEL.nv))
    for _ in range(5):
        mjw.step(model, worlds)
    mjw.forward(model, worlds)
    return model, worlds


def images(model, data, rc):
    """rgb, depth and segmentation of all cameras, from a context whose arrays hold nothing valid before."""
    rc.rgb_data.fill_(12345)
    rc.depth_data.fill_(-7.0)
    mjw.refit_bvh(model, data, rc)
    begun = time.process_time()
    mjw.render(model, data, rc)
    spent = time.process_time() - begun
    packed = rc.rgb_data.numpy()
    assert (packed >> 24 == 255).all()
    rgb = np.stack([packed >> shift & 255 for shift in (16, 8, 0)], -1).astype(int)
    return rgb, rc.depth_data.numpy().copy(), rc.seg_data.numpy().copy(), spent


HILLS = mujoco.mj_name2id(MODEL, mujoco.mjtObj.mjOBJ_GEOM, "hills")  # the height field, of which mujoco_warp misses parts


def compare(label, theirs, ours):
    rgb, depth, ids, _ = theirs
    our_rgb, our_depth, our_ids, _ = ours
    same = (ids == our_ids).all(-1)
    error = np.abs(rgb - our_rgb).max(-1)[same]
    quality = 10 * np.log10(255**2 / max(1e-9, np.mean((rgb - our_rgb)[same] ** 2.0)))
    near = np.abs(depth - our_depth) < 1e-4 * (1 + depth)
    missed = np.mean(our_ids[~same, 0] == HILLS)
    print(
        f"{label}: segmentation {same.mean():.2%} equal ({missed:.0%} of the others is the height field), depth {near.mean():.2%} within "
        f"1e-4; rgb where the geoms are equal: {quality:.1f} dB, {(error <= 1).mean():.2%} within 1 level"
    )
    assert same.mean() > 0.99, label
    assert missed > 0.9, label
    assert near.mean() > 0.99, label
    assert quality > (34 if SERIES_4 else 32), label
    assert (error <= 1).mean() > 0.98, label
    assert len(np.unique(ids[..., 0])) > 3, "the images show several geoms"


assert set(np.unique(images(*start(), context())[2][..., 1])) <= {-1, 5}
compat.use()
model, data = start()
assert compat._worlds
for options in (
    {},
    {"use_shadows": True},
    {"use_textures": False, "background_color": (0.5, 0.25, 0.75, 1.0)},
    {"render_skybox": True},
    {"use_precomputed_rays": False, "enabled_geom_groups": [0, 4]},
    *([{"enable_vertex_normals": False}, {"use_shadows": True, "shadow_light_fraction": 0.0}] if SERIES_4 else []),
):
    rc = context(**options)
    assert compat._draws(model, data, rc), compat._warp_rendering.reason_to_leave(model, MODEL, rc)
    ours = images(model, data, rc)
    compat.stop()
    theirs = images(model, data, rc)
    compat.use()
    compare(f"{options}", theirs, ours)

# Models that differ between the worlds, written between a step and the image.
rc = context(use_precomputed_rays=False)
for name, factor in (("geom_rgba", (1, 0.5, 0.2)), ("cam_fovy", (1, 0.7, 1.3)), ("light_diffuse", (1, 0, 2))):
    rows = np.repeat(getattr(model, name).numpy(), WORLDS, axis=0)
    rows *= np.reshape(factor, (WORLDS, *[1] * (rows.ndim - 1)))
    setattr(model, name, wp.array(rows.astype(np.float32), dtype=getattr(model, name).dtype))
data.geom_xpos.numpy()[1, -1] += (0.1, 0, 0.3)
data.cam_xpos.numpy()[2, 0] += (0.2, 0, 0)
ours = images(model, data, rc)
compat.stop()
theirs = images(model, data, rc)
compat.use()
compare("worlds that differ", theirs, ours)

# What stays mujoco_warp's own gives its own values.
for options in ({"enable_specular": False}, {"enable_backface_culling": False}):
    rc = context(**options)
    assert not compat._draws(model, data, rc)
    ours = images(model, data, rc)
    compat.stop()
    theirs = images(model, data, rc)
    compat.use()
    assert all((a == b).all() for a, b in zip(theirs[:3], ours[:3]))

# A graph renders when it is launched.
rc = context()
rc.rgb_data.fill_(0)
with wp.ScopedCapture() as capture:
    mjw.refit_bvh(model, data, rc)
    mjw.render(model, data, rc)
assert not rc.rgb_data.numpy().any()
wp.capture_launch(capture.graph)
assert rc.rgb_data.numpy().all()

wrong = mjw.create_render_context(MODEL, nworld=WORLDS + 1, cam_res=(8, 8), render_rgb=True)
small = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/><camera/></worldbody></mujoco>")
pair = mjw.put_model(small), mjw.put_data(small, mujoco.MjData(small), nworld=WORLDS)
short = context()
short.rgb_data = wp.zeros((WORLDS, 100), dtype=wp.uint32)
for call, text in (
    (lambda: mjw.render(model, data, wrong), f"rgb_data of the render context is for {WORLDS + 1} worlds"),
    (lambda: mjw.render(*pair, context()), "the render context belongs to another model"),
    (lambda: mjw.render(model, data, short), "rgb_data of the render context has 100 pixels for each world, and camera 0 of it needs"),
):
    try:
        call()
    except ValueError as error:
        assert text in str(error), error
    else:
        sys.exit(f"no error: {text}")

# Time of an image.
rc = mjw.create_render_context(MODEL, nworld=WORLDS, cam_res=(160, 120), render_rgb=True, cam_active=[True, False, False], use_shadows=True)
images(model, data, rc)
ours = min(images(model, data, rc)[3] for _ in range(5))
compat.stop()
images(model, data, rc)
theirs = min(images(model, data, rc)[3] for _ in range(5))
print(f"an image of 160 x 120 with shadows: {1e3 * theirs / WORLDS:.2f} ms of CPU time, with mjsense {1e3 * ours / WORLDS:.2f} ms")
