# SPDX-License-Identifier: Apache-2.0
"""Sensors on mujoco_warp's worlds (CPU device) give the values of the C++ sensors in the same states."""

import importlib

import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason="mujoco_warp is not installed: pip install 'mjsense[warp]'")

import mjsense as mjs
from mjsense.core.arrays import on_host

effects = mjs.effects
WORLDS = 16
rng = np.random.default_rng(3)


def numbers(values):
    return " ".join(f"{x:.4f}" for x in np.ravel(values))


def pose():
    return f'pos="{numbers([*rng.uniform(-3, 3, 2), rng.uniform(0, 2)])}" euler="{numbers(rng.uniform(-180, 180, 3))}"'


def primitives():
    kinds = ["sphere", "capsule", "ellipsoid", "cylinder", "box"]
    geom = '<geom type="{}" {} size="{}" group="{}" rgba="{} .5 .5 {}"/>'
    return "", [
        geom.format(kinds[i % 5], pose(), numbers(rng.uniform(0.1, 0.5, 3)), i % 4, rng.uniform(), int(i % 7 != 0))
        for i in range(40)
    ]


def meshes():
    asset = f'<mesh name="m" vertex="{numbers(rng.normal(size=(60, 3)) * 0.4)}"/>'
    return asset, [f'<geom type="mesh" mesh="m" {pose()}/>' for _ in range(12)]


def height_field():
    heights = rng.uniform(0, 1, (17, 23))
    asset = f'<hfield name="h" nrow="17" ncol="23" size="4 3 .8 .2" elevation="{numbers(heights)}"/>'
    return asset, ['<geom type="hfield" hfield="h" pos="0 0 -.5" euler="3 5 10"/>']


SCENES = {"primitives": primitives(), "meshes": meshes(), "height field": height_field()}


def model(scene):
    asset, geoms = SCENES[scene]
    return f"""
    <mujoco>
      <default><geom contype="0" conaffinity="0"/></default>
      <asset>{asset}<material name="floor" rgba=".3 .4 .5 1"/></asset>
      <worldbody>
        <light pos="0 0 5"/>
        <geom type="plane" size="0 0 1" pos="0 0 -1" material="floor"/>
        {"".join(geoms)}
        <body name="trunk" pos="0 0 1.2">
          <freejoint/>
          <geom size=".05"/>
          <site name="device" pos=".1 0 0" euler="10 20 30"/>
          <body name="leg" pos=".3 0 0"><joint name="hip" type="hinge"/><geom name="foot" type="capsule" size=".05 .2"/></body>
        </body>
      </worldbody>
      <sensor><gyro name="gyro" site="device"/></sensor>
    </mujoco>"""


def ref(kind, name):
    return mjs.ObjRef(type=kind, name=name, entity="robot")


def states():
    """Positions of the trunk, half of them upright."""
    qpos = np.zeros((WORLDS, 8))
    qpos[:, :3] = np.c_[rng.uniform(-2, 2, (WORLDS, 2)), rng.uniform(0.2, 2, WORLDS)]
    qpos[:, 3:7] = rng.normal(size=(WORLDS, 4))
    qpos[: WORLDS // 2, 3:7] = [1, 0, 0, 0]
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7] = rng.uniform(-2, 2, WORLDS)
    return qpos.astype(np.float32)


def simulations(scene, *sensors, **options):
    """The same scene on both backends."""
    cfg = mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=model(scene))}, sensors=sensors)
    made = [
        mjs.Simulation(mjs.Scene(cfg), WORLDS, **options),
        mjs.Simulation(mjs.Scene(cfg), WORLDS, backend="warp", device="cpu", **options),
    ]
    for sim in made:
        sim.scene["robot/gyro"]  # exists with both backends
    return made


def arrays(sim, name):
    fields = {field: np.array(values) for field, values in sim.scene[name].fields.items()}
    assert {field: (a.shape, a.dtype) for field, a in fields.items()} == {
        field: ((WORLDS, *spec.shape), np.dtype(spec.dtype)) for field, spec in sim.scene[name].specs.items()
    }
    return fields


def same(cpu, warp, bounds, allowed=0):
    """Ids are equal, except for a number of rays; other values differ by at most the bound of their field, where ids are equal."""
    assert warp.keys() == cpu.keys()
    other = cpu["geom_id"] != warp["geom_id"] if "geom_id" in cpu else np.zeros(1, bool)
    assert other.sum() <= allowed
    for name, expected in cpu.items():
        error = np.abs(expected.astype(float) - warp[name])
        if error.shape[:2] == other.shape:
            error = error[~other]
        assert error.max() <= bounds.get(name, 0), name


RAY_BOUNDS = {
    "distances": 4e-5, "hit_pos_w": 4e-5, "normals_w": 3e-4, "frame_pos_w": 3e-7, "frame_quat_w": 3e-7, "pos_w": 3e-7, "quat_w": 3e-7,
    "heights": 4e-6, "points": 4e-5, "intensity": 3e-4,
}  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_rays(scene):
    trunk, device, leg, foot = ref("body", "trunk"), ref("site", "device"), ref("body", "leg"), ref("geom", "foot")
    anywhere = mjs.UserPatternCfg(
        offsets=rng.uniform(-0.1, 0.1, (200, 3)).tolist(), directions=rng.normal(size=(200, 3)).tolist()
    )
    grid, ring = mjs.GridPatternCfg(size=(1.6, 1.0)), mjs.RingPatternCfg.single_ring()
    rays = [
        mjs.RayCastSensorCfg("all", frame=(trunk, device), pattern=anywhere, include_geom_groups=None, max_distance=8),
        mjs.RayCastSensorCfg("scan", frame=trunk, pattern=grid, ray_alignment="yaw", max_distance=1.5),
        mjs.RayCastSensorCfg(
            "camera", frame=foot, pattern=mjs.PinholeCameraPatternCfg(), ray_alignment="world", min_distance=0.3
        ),
        mjs.RayCastSensorCfg("own", frame=leg, pattern=anywhere, exclude_parent_body=False, hit_ids=False),
        *(
            mjs.TerrainHeightSensorCfg(
                how, frame=(trunk, foot), pattern=ring, reduction=how, ray_alignment="yaw", max_distance=0.8
            )
            for how in ("min", "max", "mean", "none")
        ),
        mjs.LidarSensorCfg("lidar", frame=device, scan=mjs.SpinningScanCfg(channels=8, samples=45), max_distance=20),
    ]
    cpu, warp = simulations(scene, *rays)
    qpos = states()
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos)
    hits = 0
    for cfg in rays:
        expected = arrays(cpu, cfg.name)
        same(expected, arrays(warp, cfg.name), RAY_BOUNDS)
        hits += (expected["distances"] > 0).sum()
    assert hits > 3000


def test_a_lidar_has_the_same_noise():
    device, scan = ref("site", "device"), mjs.SpinningScanCfg(channels=8, samples=45)
    common = {"frame": (device, ref("body", "trunk")), "max_distance": 20}
    angles = rng.uniform(-1, 1, (100, 2)).tolist()
    lidars = [
        mjs.LidarSensorCfg("noise", scan=scan, range_noise_std=0.02, range_noise_relative=0.01, **common),
        mjs.LidarSensorCfg("dropout", scan=scan, dropout=0.3, **common),
        mjs.LidarSensorCfg("both", scan=scan, dropout=0.3, range_noise_std=0.02, **common),
        mjs.LidarSensorCfg("table", scan=mjs.TableScanCfg(angles=angles, rays_per_scan=30, rate_hz=100), **common),
    ]
    cpu, warp = simulations("primitives", *lidars, decimation=2, seed=5)
    qpos = states()
    for _ in range(4):
        for sim in (cpu, warp):
            sim.step()
            sim.set_state(qpos=qpos)
        for cfg in lidars:
            same(arrays(cpu, cfg.name), arrays(warp, cfg.name), RAY_BOUNDS)


def test_rays_with_times():
    """Rays start from the poses that the frames had at their times, also shortly after a reset."""
    device, scan = ref("site", "device"), mjs.SpinningScanCfg(channels=8, samples=45, rate_hz=20)
    directions = rng.normal(size=(60, 3)).tolist()
    times = np.round(rng.uniform(-0.03, 0, 60), 3).tolist()
    rays = [
        mjs.LidarSensorCfg("sweep", frame=device, scan=scan, motion_distortion=True, max_distance=20),
        mjs.LidarSensorCfg("noisy", frame=device, scan=scan, motion_distortion=True, max_distance=20, range_noise_std=0.02),
        mjs.RayCastSensorCfg(
            "timed", frame=device, pattern=mjs.UserPatternCfg(directions=directions, times=times), ray_alignment="yaw"
        ),
    ]
    cpu, warp = simulations("primitives", *rays, decimation=4, seed=5)
    qpos, qvel = states(), rng.normal(size=(WORLDS, 7)).astype(np.float32) * 3
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos, qvel=qvel)
    for step in range(8):
        for sim in (cpu, warp):
            sim.step()
            if step == 4:
                sim.reset([2, 5])
        for cfg in rays:
            expected = arrays(cpu, cfg.name)
            same(
                expected,
                arrays(warp, cfg.name),
                dict.fromkeys(RAY_BOUNDS, 2e-3) | {"intensity": 1e-2, "normals_w": 1e-2},
                allowed=3,
            )


CHAINS = {
    "gaussian": [effects.Noise(effects.Gaussian((0.3, 0.2, 0.1), 0.1))],
    "density": [effects.Noise(effects.Gaussian(0.3), density=0.02)],
    "uniform": [effects.Noise(effects.Uniform(-1, 2), operation="scale", density=(0.02, 0, 0.1))],
    "bias": [effects.EpisodeBias(effects.Gaussian(0.5)), effects.EpisodeBias(effects.Uniform(-1, 1), operation="add", per_component=False)],
    "drift": [effects.BiasDrift(std=0.3, time_constant_s=0.4), effects.BiasDrift(density=0.2, start_at_zero=True)],
    "calibration": [
        effects.Scale((1.1, 0.9, 2)), effects.Misalignment(scale_error_std=0.05, angle=(0.1, 0.2, 0.3), angle_std=0.04),
        effects.Clip(-1, (0.5, 1, 2)), effects.Quantize(0.01),
    ],
    "delay": [effects.Delay(delay_s=0.012, delay_max_s=0.06, jitter_s=0.02, interpolate=True)],
    "held delay": [effects.Delay(delay_s=0.03, jitter_s=0.02)],
    "steps": [effects.StepDelay(1, 4, hold_probability=0.3, update_period=3)],
    "common steps": [effects.StepDelay(0, 5, per_world=False)],
    "rate": [effects.Rate(37.0, random_phase=True)],
    "dropout": [effects.Rate(50.0, phase_s=0.003), effects.Dropout(0.3)],
    "zero": [effects.Dropout(0.4, mode="zero"), effects.NanPolicy()],
}  # fmt: skip


def test_effects_are_equal_bit_for_bit():
    """All effects on the same input, with resets of some worlds and repeated measurements of a step."""
    import warp

    from mjsense.warp.effects import Chain

    noisy = [
        mjs.EffectSensorCfg(name, sensor="robot/gyro", effects=tuple(chain), history_length=k % 3)
        for k, (name, chain) in enumerate(CHAINS.items())
    ]
    cfg = mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=model("primitives"))}, sensors=tuple(noisy))
    cpu = mjs.Simulation(mjs.Scene(cfg), WORLDS, decimation=2, seed=11)
    source = warp.zeros((WORLDS, 3), dtype=float, device="cpu")
    clock = Clock(cpu, warp)
    chains = {}
    for sensor in noisy:
        out = warp.zeros((WORLDS, 3 * max(1, sensor.history_length)), dtype=float, device="cpu")
        chains[sensor.name] = Chain(clock, sensor.effects, sensor.name, source, out, sensor.history_length)

    def compare():
        source.assign(np.array(cpu.scene["robot/gyro"].data))
        for name, chain in chains.items():
            chain.apply()
            assert chain.out.numpy().tobytes() == cpu.scene[name].data.tobytes(), name

    def reset(worlds):
        mask = clock.reset(worlds)
        for chain in chains.values():
            chain.reset(mask)
        compare()

    reset(np.arange(WORLDS))
    for step in range(120):
        if step in (40, 75, 76):
            worlds = [1, step % WORLDS]
            cpu.reset(worlds)
            reset(worlds)
        if step % 29 == 7:
            cpu.set_state(qvel=rng.normal(size=cpu.qvel.shape))
            compare()
        cpu.step()
        clock.tick.assign(clock.tick.numpy() + 2)
        compare()


class Clock:
    """The clocks of worlds on the CPU, for a chain without a simulation."""

    def __init__(self, sim, warp):
        self.num_worlds, self.device, self.physics_dt, self.step_dt = sim.num_worlds, "cpu", sim.physics_dt, sim.step_dt
        self.seed = warp.array([sim.seed], dtype=warp.uint64, device="cpu")
        self.key = warp.array(np.arange(sim.num_worlds), dtype=warp.uint32, device="cpu")
        self.tick = warp.zeros(sim.num_worlds, dtype=warp.int64, device="cpu")
        self.episode = warp.zeros(sim.num_worlds, dtype=warp.int64, device="cpu")
        self.mask = warp.zeros(sim.num_worlds, dtype=bool, device="cpu")

    def reset(self, worlds):
        self.mask.assign(np.isin(np.arange(self.num_worlds), worlds))
        self.episode.assign(self.episode.numpy() + self.mask.numpy())
        return self.mask


def test_effect_sensors_and_imus():
    """In a simulation: the input differs by float32 arithmetic, the errors are the same."""
    site = ref("site", "device")
    sensors = [
        *(
            mjs.ImuSensorCfg(f"imu_{preset}", site=site, preset=preset, orientation=True)
            for preset in ("ideal", "mpu6050", "icm42688p")
        ),
        mjs.EffectSensorCfg(
            "noisy", sensor="robot/gyro", effects=(effects.Noise(effects.Gaussian(0.3)), effects.Delay(0.02)), history_length=3
        ),
    ]
    cpu, warp = simulations("primitives", *sensors, decimation=2, seed=5)
    qpos = states()
    qpos[:, 2] += 10  # nothing is in contact
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos, qvel=rng.normal(size=(WORLDS, 7)).astype(np.float32) * 0 + 0.5)
    for _ in range(10):
        for sim in (cpu, warp):
            sim.step()
        for cfg in sensors:
            # A value at the border between two counts of the device may be rounded to the other one.
            count = {"imu_mpu6050": {"acc": 5e-3, "gyro": 1.1e-3}, "imu_icm42688p": {"acc": 5e-3, "gyro": 1.1e-3}}.get(
                cfg.name, {}
            )
            bounds = {"acc": 2e-4, "gyro": 1e-4, "quat": 1e-5, "": 1e-4} | count
            same(arrays(cpu, cfg.name), arrays(warp, cfg.name), bounds)


@pytest.mark.parametrize("scene", SCENES)
def test_cameras(scene):
    view = {"parent_body": "robot/trunk", "pos": (0, 0, 0.3), "quat": (0.8, 0.4, 0.3, 0.2), "width": 40, "height": 30}
    types = ("rgb", "depth", "segmentation", "body_segmentation", "entity_segmentation", "point_cloud", "normals")
    cameras = [
        mjs.CameraSensorCfg("all", data_types=types, enabled_geom_groups=(0, 1, 2, 3), **view),
        mjs.CameraSensorCfg(
            "k", data_types=("depth",), depth_kind="ray", intrinsics=mjs.CameraIntrinsics(40, 42, 19, 16), **view
        ),
        mjs.CameraSensorCfg("parallel", data_types=("depth",), orthographic=True, fovy=2, **view),
    ]
    cpu, warp = simulations(scene, *cameras)
    qpos = states()
    qpos[:, 2] += 2
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos)
    for cfg in cameras:
        expected, found = arrays(cpu, cfg.name), arrays(warp, cfg.name)
        depth = expected["depth"][..., 0]
        near = depth < 100  # mujoco_warp does not see endless planes at distances above 350 m
        assert (near & (depth > 0)).mean() > 0.1
        other = np.abs(depth - found["depth"][..., 0]) > 1e-3
        assert (other & near).sum() <= 3  # at borders of height fields
        near &= ~other
        for name in expected:
            if name.endswith("segmentation"):
                assert (expected[name] == found[name])[near].all(), name
        assert np.array_equal(expected["intrinsics"], found["intrinsics"])
        assert np.abs(expected["pose"] - found["pose"]).max() < 1e-6
    all_cpu, all_warp = arrays(cpu, "all"), arrays(warp, "all")
    near = (all_cpu["depth"][..., 0] < 100) & (all_cpu["depth"][..., 0] > 0)
    assert np.abs(all_cpu["point_cloud"] - all_warp["point_cloud"])[near].max() < 1e-3
    assert np.abs(all_cpu["rgb"].astype(int) - all_warp["rgb"])[near].mean() < 2
    other = np.abs(all_cpu["normals"] - all_warp["normals"]).max(-1) > 1e-3
    assert (other & near).sum() <= 3 and np.abs(all_cpu["normals"]).max(-1)[near].min() > 0.5


def test_cameras_with_a_period_and_a_delay():
    camera = mjs.CameraSensorCfg(
        "slow", parent_body="robot/trunk", pos=(0, 0, 0.3), width=16, height=12, data_types=("rgb", "depth", "segmentation"),
        update_period=0.012, phase=0.004,
    )  # fmt: skip
    late = mjs.EffectSensorCfg("late", sensor="slow", effects=(effects.StepDelay(1, 2), effects.Dropout(0.3)))
    cpu, warp = simulations("meshes", camera, late, decimation=2)
    qpos, qvel = states(), rng.normal(size=(WORLDS, 7)).astype(np.float32)
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos + np.eye(1, 8, 2, dtype=np.float32) * 2, qvel=qvel)
    images = set()
    for step in range(12):
        for sim in (cpu, warp):
            if step == 7:
                sim.reset([3])
            sim.step()
        for name in ("slow", "late"):
            expected, found = arrays(cpu, name), arrays(warp, name)
            near = expected["depth"][..., 0] < 100
            other = near & (expected["segmentation"] != found["segmentation"]).any(-1)
            assert other.sum() <= 3
            near &= ~other
            assert np.abs(expected["depth"] - found["depth"])[near].max() < 5e-3
            assert np.abs(expected["rgb"].astype(int) - found["rgb"])[near].mean() < 2
        images.add(arrays(cpu, "slow")["rgb"][0].tobytes())
    assert 2 < len(images) < 12


def test_rays_follow_models_that_differ_by_world():
    """Fixed geoms are in a tree that all worlds share, until they differ."""
    scan = mjs.RayCastSensorCfg(
        "scan", frame=ref("body", "trunk"), pattern=mjs.GridPatternCfg(size=(1.6, 1.0)), ray_alignment="world"
    )
    cpu, warp = simulations("primitives", scan)
    assert cpu.model.ngeom > 24
    qpos, positions = states(), cpu.model.geom_pos + rng.uniform(-0.5, 0.5, (WORLDS, cpu.model.ngeom, 3))
    sizes = cpu.model.geom_size * rng.uniform(0.5, 1.5, (WORLDS, cpu.model.ngeom, 1))
    for sim in (cpu, warp):
        sim.set_state(qpos=qpos)
    same(arrays(cpu, "scan"), arrays(warp, "scan"), RAY_BOUNDS)
    for sim in (cpu, warp):
        sim.randomize("geom_pos", positions)
        sim.randomize("geom_size", sizes)
    same(arrays(cpu, "scan"), arrays(warp, "scan"), RAY_BOUNDS)


def test_options_that_the_backend_lacks_are_errors():
    camera = {"parent_body": "robot/trunk", "width": 8, "height": 8}
    for cfg, what in [
        (mjs.CameraSensorCfg("x", data_types=("flow",), **camera), "data type 'flow'"),
        (mjs.CameraSensorCfg("x", samples=4, **camera), "samples > 1"),
        (mjs.CameraSensorCfg("x", shading="path", **camera), "shading='path' \\(it has classic shading only"),
        (mjs.CameraSensorCfg("x", data_types=("depth",), depth_noise="d435", **camera), "depth_noise"),
    ]:
        with pytest.raises(ValueError, match=f"sensor 'x': {what}.* is not available with backend='warp'"):
            simulations("primitives", cfg)


def test_ray_sensors_refuse_flexes():
    cloth = """
    <mujoco><worldbody><body name="trunk"><freejoint/><geom size=".1"/></body>
      <flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" mass="1" pos="0 0 1"><edge equality="true"/></flexcomp></worldbody></mujoco>"""
    scan = mjs.RayCastSensorCfg("scan", frame=mjs.ObjRef("body", "trunk"), pattern=mjs.GridPatternCfg())
    with pytest.raises(ValueError, match="sensor 'scan': a model with flexes is not available with backend='warp'"):
        mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=cloth, sensors=[scan])), 2, backend="warp", device="cpu")
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=cloth)), 2, backend="warp", device="cpu")
    sim.step()  # the physics has them
    assert on_host(sim.qpos)[0, 9] < 0


def test_a_camera_refuses_other_fields_of_view():
    _, warp = simulations(
        "primitives", mjs.CameraSensorCfg("x", parent_body="robot/trunk", width=8, height=8, data_types=("depth",))
    )
    with pytest.raises(ValueError, match=r"sensor 'x': randomize\('cam_fovy'\) is not available with backend='warp'"):
        warp.randomize("cam_fovy", 60)


def test_a_nan_policy_raises():
    refuse = mjs.EffectSensorCfg("x", sensor="robot/gyro", effects=(effects.Dropout(1.0, mode="nan"), effects.NanPolicy("error")))
    _, warp = simulations("primitives", refuse)
    warp.scene["x"].data  # the first row of an episode is never lost
    warp.step()
    with pytest.raises(RuntimeError, match=r"sensor 'x', effect 1 \(nan_policy\): 3 of 3 values are not finite in world 0"):
        warp.scene["x"].data


@pytest.mark.parametrize(
    "module",
    """
        camera camera_normals contact_kernels contact_lists contact_memory effect_errors effect_timing effects kernels lidar
        pose_history rays terrain_height
        """.split(),
)
@pytest.mark.filterwarnings("error:Generic kernels without overloads")  # Warp leaves them out
def test_kernels_compile_for_cuda_devices(module, tmp_path):
    """Warp contains the compiler for CUDA devices, which needs no such device."""
    import warp

    kernels = importlib.import_module(f"mjsense.warp.{module}")
    if module == "kernels":
        for dtype in (warp.float32, warp.int32, warp.bool):  # those of the state
            array = warp.array2d(dtype=dtype)
            warp.overload(kernels.copy_rows, {"source": array, "target": array})
    warp.compile_aot_module(kernels, arch=80, module_dir=tmp_path, use_ptx=True)
    assert list(tmp_path.glob("*.ptx"))
