# SPDX-License-Identifier: Apache-2.0
"""mjs.render: recorded episodes with other cameras and sensors, as a new recording."""

import inspect
import json
import shutil
import signal
import subprocess
import sys
import time

import gymnasium
import h5py
import numpy as np
import pytest
import tasks
from edited_recordings import changed, file_of
from program_runs import run_program

import mjsense as mjs
from mjsense.core.declared_fields import declared_fields
from mjsense.dataset import render_cameras

RECORDING = dict(num_worlds=2, episodes=3, keep_failures=True, horizon=8, seed=5, width=48, height=32, depth=True)
TOP = {"pos": (0.5, 0, 1.6), "lookat": (0.5, 0, 0)}
HAND = {"body": "robot_0/gripper/base", "pos": (0.1, 0, 0), "quat": (0, 1, 0, 0), "fovy": 70, "depth": True}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    out = tmp_path_factory.mktemp("recorded")
    mjs.record("pick", out=out, segmentation=True, **RECORDING)
    return out


def verified(out):
    done = run_program("verify", str(out))
    assert done.returncode == 0 and "note" not in done.stdout, done.stdout + done.stderr
    return done.stdout


def numbers(root):
    """Every dataset of every episode, and its attributes."""
    found = {}
    for path in sorted(root.glob("house_*/*.h5")):
        with h5py.File(path) as file:
            for trajectory in file.values():
                number = int(trajectory.attrs["episode"])
                found[number, ""] = dict(trajectory.attrs)

                def add(name, item, number=number):
                    if isinstance(item, h5py.Dataset):
                        value = item[()]
                        found[number, name] = (
                            value if isinstance(value, bytes) else (value.dtype, value.shape, value.tobytes()),
                            {key: np.array(of).tolist() for key, of in item.attrs.items()},
                        )

                trajectory.visititems(add)
    return found


def videos(root):
    return {path.name: path.read_bytes() for path in root.glob("house_*/*.m[pk][4v]")}


def test_the_same_cameras_give_the_same_files(recorded, tmp_path):
    """Depth is bit-equal, and so is rgb before encoding, because the encoder makes equal files of equal images."""
    seen = []
    made = mjs.render(recorded, tmp_path, copy=False, num_worlds=2, progress=seen.append)
    assert (made.finished, made.wanted, made.frames) == (3, 3, 3 * 9 * 4) and made.paths == [tmp_path / "house_0"]
    assert seen[-1].finished == 3
    assert "3 episodes" in verified(tmp_path)
    assert numbers(tmp_path) == numbers(recorded)
    assert videos(tmp_path) == videos(recorded)
    assert mjs.check_replay(tmp_path)
    dataset = mjs.Dataset(tmp_path)
    assert dataset.episodes[0].settings["render"]["of"]["settings"]["task"] == "pick"


def test_image_options_are_those_of_cameras_and_of_render():
    """An option that is added to ImageCfg is one of cameras and of render."""
    given = render_cameras.image_options()
    assert declared_fields("ImageCfg").keys() - given.keys() == {"width", "height", "depth", "segmentation"}
    assert set(given) <= inspect.signature(mjs.render).parameters.keys()


PHYSICAL = set(
    """
    exposure exposure_mode exposure_time_constant imager motion_samples tone_mapping white_balance environment
    environment_intensity environment_rotation ambient_occlusion
    """.split()
)
VALUES = {
    "shading": "pbr",
    "samples_per_pixel": 2,
    "exposure_mode": "auto",
    "imager": "d435",
    "tone_mapping": "agx",
    "environment": "skybox",
    "white_balance": 4000,
}


def write_sky(path):
    """Surroundings with a bright quarter."""
    pixels = np.full((8, 16, 4), (60, 70, 90, 128), np.uint8)
    pixels[:4, :4] = (255, 240, 200, 131)
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + pixels.tobytes())
    return str(path)


@pytest.fixture(scope="module")
def videos_with(tmp_path_factory):
    """A function that records an episode with image options, once for each set, and returns the folder and its videos."""
    made = {}

    def find(options):
        key = json.dumps(options, sort_keys=True)
        if key not in made:
            out = tmp_path_factory.mktemp("short")
            mjs.record("pick", out=out, cameras=["wrist_camera"], **{**RECORDING, "episodes": 1, "horizon": 3, **options})
            made[key] = out, videos(out)
        return made[key]

    return find


@pytest.mark.parametrize("option", render_cameras.image_options())
def test_every_image_option_is_kept(option, videos_with, tmp_path):
    few = {"samples_per_pixel": 1} if option == "samples_per_pixel" else {}
    default = few.get(option, render_cameras.recorded_images({})[option])
    value = VALUES.get(option, not default if isinstance(default, bool) else 4)
    physical = {"shading": "pbr"} if option in PHYSICAL else {"shading": "path", **few} if few else {}
    file = {"environment": write_sky(tmp_path / "sky.hdr")} if option == "environment_rotation" else {}
    if option == "exposure_time_constant":
        physical["exposure_mode"] = "auto"
    if option == "motion_samples":
        physical["imager"] = "d435"
    given = {**physical, **file, option: value}
    _, usual = videos_with({**physical, **file})
    root, changed_images = videos_with(given)
    assert changed_images != usual
    mjs.render(root, tmp_path / "same", copy=False, **given)
    # An image sensor draws other random numbers.
    assert (videos(tmp_path / "same") == changed_images) == (option not in ("imager", "motion_samples"))
    assert mjs.Dataset(tmp_path / "same").episodes[0].settings[option] == value
    mjs.render(root, tmp_path / "back", **{**given, option: default})
    assert (videos(tmp_path / "back") == usual) == (option != "motion_samples")


def test_a_file_that_a_recording_names_is_not_opened(tmp_path):
    path = tmp_path / "sky.hdr"
    sky = write_sky(path)
    options = {**RECORDING, "episodes": 1, "horizon": 3, "shading": "pbr"}
    mjs.record("pick", out=tmp_path / "data", environment=sky, **options)
    assert mjs.Dataset(tmp_path / "data").episodes[0].settings["environment"] == sky
    with pytest.raises(ValueError, match="the recording names a file, and files are not taken from a recording"):
        mjs.render(tmp_path / "data", tmp_path / "out", copy=False)
    mjs.render(tmp_path / "data", tmp_path / "classic", copy=False, shading="classic")
    report = mjs.check_replay(tmp_path / "data", states=True)
    assert report and "environment" in str([episode.sensors.not_computed for episode in report.episodes])
    path.write_bytes(path.read_bytes()[:-1] + b"\x83")
    with pytest.raises(ValueError, match="environment_file"):
        mjs.record("pick", out=tmp_path / "data", environment=sky, **options, resume=True)


def test_options_of_files_are_as_recorded_unless_they_are_given(recorded, tmp_path):
    before = mjs.Dataset(recorded).episodes[0]._recording
    mjs.render(recorded, tmp_path / "videos", keyint=3)
    mjs.render(recorded, tmp_path / "arrays", gzip=1)
    encoded, copied = (mjs.Dataset(tmp_path / name).episodes[0]._recording for name in ("videos", "arrays"))
    assert (encoded.video, encoded.gzip, copied.gzip) == (before.video | {"keyint": 3}, before.gzip, 1)
    assert videos(tmp_path / "arrays") == videos(recorded) != videos(tmp_path / "videos")


@pytest.mark.parametrize(
    "task, robot", (("open", "i2rt_yam"), ("nav_to_obj", "rby1"), ("packing", "franka"), ("pick", "floating_rum"))
)
def test_other_tasks_and_robots(task, robot, tmp_path):
    """tools/replay_table.py checks all of them."""
    mjs.record(task, robot, out=tmp_path / "data", max_attempts=1, **{**RECORDING, "episodes": 1, "num_worlds": 1, "horizon": 4})
    mjs.render(tmp_path / "data", tmp_path / "out", copy=False)
    assert videos(tmp_path / "out") == videos(tmp_path / "data") and numbers(tmp_path / "out") == numbers(tmp_path / "data")
    report = mjs.check_replay(tmp_path / "data", states=True)
    assert report, report


def test_files_do_not_depend_on_worlds_and_threads(recorded, tmp_path):
    mjs.render(recorded, tmp_path / "a", cameras=[], add_cameras={"top": TOP}, num_worlds=1, threads=1)
    mjs.render(recorded, tmp_path / "b", cameras=[], add_cameras={"top": TOP}, num_worlds=3, threads=2)
    a, b = ({p.relative_to(out): p.read_bytes() for p in out.rglob("*.*")} for out in (tmp_path / "a", tmp_path / "b"))
    assert a == b and len(a) == 5


def test_added_cameras(recorded, tmp_path):
    mjs.render(recorded, tmp_path, cameras=["wrist_camera"], add_cameras={"top": TOP, "hand": HAND})
    verified(tmp_path)
    assert {name: data for name, data in videos(tmp_path).items() if "wrist" in name} == {
        name: data for name, data in videos(recorded).items() if "wrist" in name
    }
    dataset = mjs.Dataset(tmp_path)
    assert sorted(name for name in dataset.streams if name.startswith("obs/sensor_data/")) == [
        f"obs/sensor_data/{name}" for name in ("hand", "hand_depth", "top", "wrist_camera", "wrist_camera_depth")
    ]
    episode = dataset.episodes[2]
    parameters = episode["obs/sensor_param/top/cam2world_gl"]
    np.testing.assert_allclose(parameters[:, :3, 3], [[0.5, 0, 1.6]] * 9, atol=1e-12)
    np.testing.assert_allclose(parameters[:, :3, 2], [[0, 0, -1]] * 9, atol=1e-12)  # it looks down
    model, bodies = episode.model(), []
    hand = model.body("robot_0/gripper/base").id
    for t, data in episode.replay():
        bodies.append(data.xpos[hand] + data.xmat[hand].reshape(3, 3) @ HAND["pos"])
    np.testing.assert_allclose(episode["obs/sensor_param/hand/cam2world_gl"][:, :3, 3], bodies, atol=1e-9)
    with h5py.File(episode.path) as file:
        trajectory = file[episode.trajectory]
        assert sorted(trajectory["obs/sensor_param"]) == ["hand", "top", "wrist_camera"]
        assert (
            "exo_camera_1_segmentation" not in trajectory["obs/extra"] and "wrist_camera_segmentation" in trajectory["obs/extra"]
        )
    assert episode.video("top")[0].std() > 10
    # A rendering can be rendered again, with its added cameras.
    assert mjs.render(tmp_path, tmp_path / "again", copy=False).frames == 3 * 9 * 5
    assert mjs.render(tmp_path, tmp_path / "copies").frames == 0
    assert videos(tmp_path / "again") == videos(tmp_path) == videos(tmp_path / "copies")


@pytest.mark.parametrize(
    "pos, lookat, up", (((1, 2, 3), (0, 0, 0), (0, 0, 1)), ((0, 0, 1), (0, 0, 0), (0, 0, 1)), ((-1, 0, 0), (2, 1, -1), (1, 1, 0)))
)
def test_orientation(pos, lookat, up):
    from mjsense.dataset.render_cameras import added_camera

    w, *v = added_camera("x", {"pos": pos, "lookat": lookat, "up": up}, (64, 48)).quat

    def rotated(a):
        return np.array(a) + 2 * np.cross(v, np.cross(v, a) + w * np.array(a))

    forward = np.subtract(lookat, pos) / np.linalg.norm(np.subtract(lookat, pos))
    np.testing.assert_allclose(rotated([0, 0, -1]), forward, atol=1e-9)
    assert abs(rotated([1, 0, 0]) @ up) < 1e-9 and rotated([0, 1, 0]) @ up > -1e-9


def test_sizes_depth_and_segmentation(recorded, tmp_path):
    mjs.render(recorded, tmp_path, width=64, depth=False, segmentation=False, episodes=[1])
    verified(tmp_path)
    episode = mjs.Dataset(tmp_path).episodes[0]
    assert episode.number == 1 and episode.video("wrist_camera").shape == (9, 42, 64, 3)
    assert not any("depth" in name or "segmentation" in name for name in episode.streams)


def test_camera_system(tmp_path):
    """The cameras of a system, with its variation, are those of a recording with this system."""
    about = dict(task="pick", robot="franka", **{**RECORDING, "episodes": 4})
    mjs.record(out=tmp_path / "plain", **about)
    mjs.record(out=tmp_path / "wanted", camera_system="randomized_droid", **about)
    mjs.render(tmp_path / "plain", tmp_path / "made", camera_system="randomized_droid", width=48, height=32, depth=True)
    verified(tmp_path / "made")
    assert videos(tmp_path / "made") == videos(tmp_path / "wanted")


def test_light(recorded, tmp_path):
    def edit(spec):
        spec.worldbody.add_light(name="lamp", pos=[0.5, 0, 2], dir=[0, 0, -1], diffuse=[1, 0, 0])

    mjs.render(recorded, tmp_path / "dark", brightness=0.3, shadows=False, episodes=[0])
    mjs.render(recorded, tmp_path / "lamp", edit=edit, episodes=[0])
    mjs.render(tmp_path / "dark", tmp_path / "again", copy=False)
    assert videos(tmp_path / "again") == videos(tmp_path / "dark")
    before, dark, lamp = (
        mjs.Dataset(out).episodes[0].video("wrist_camera")[0].mean((0, 1))
        for out in (recorded, tmp_path / "dark", tmp_path / "lamp")
    )
    assert dark.mean() < 0.6 * before.mean() and lamp[0] > before[0] + 5


class Height(mjs.Sensor):
    """Height of the gripper. [m]"""

    uuid = "height"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64)

    def compute(self, sim):
        return sim.data.xpos[:, sim.model.body("robot_0/gripper/base").id, 2:3]


def test_sensors(recorded, tmp_path):
    (tmp_path / "sensors.toml").write_text(
        '[[sensors]]\nkind = "contact"\nname = "fingers"\nprimary = { mode = "body", pattern = ["robot_0/gripper/left_finger"] }\n'
        '[[sensors]]\nkind = "lidar"\nname = "scan"\nframe = { type = "body", name = "robot_0/gripper/base" }\n'
        'scan = { kind = "spinning", channels = 2, samples = 8 }\n'
    )
    from mjsense.dataset.sensor_tables import sensors_of

    mjs.render(
        recorded,
        tmp_path / "out",
        cameras=[],
        sensors=lambda: [*sensors_of(tmp_path / "sensors.toml"), Height(), mjs.sensors.PoseSensor("hand", body="robot_0/gripper/base")],
    )
    verified(tmp_path / "out")
    episode = mjs.Dataset(tmp_path / "out").episodes[0]
    assert episode["obs/extra/fingers/found"].shape[0] == 9 and episode["obs/extra/scan/distances"].shape == (9, 16)
    hand = episode["obs/extra/hand"]
    np.testing.assert_allclose(episode["obs/extra/height"][:, 0], hand[:, 2], rtol=1e-6)
    assert np.ptp(hand[:, :3], 0).max() > 0.001


def test_resume_after_an_interruption(recorded, tmp_path):
    class Stop(Exception):
        pass

    def stop(now):
        if now.finished >= 1:
            raise Stop

    about = dict(cameras=[], add_cameras={"top": TOP}, num_worlds=1, batches=1)
    mjs.render(recorded, tmp_path / "whole", **about)
    for _ in range(2):
        with pytest.raises(Stop):
            mjs.render(recorded, tmp_path / "out", progress=stop, resume=True, **about)
    with pytest.raises(ValueError, match="a different recording: 'settings/samples' was 1 and is now 2"):
        mjs.render(recorded, tmp_path / "out", resume=True, samples=2, **about)
    mjs.render(recorded, tmp_path / "out", resume=True, **about)
    whole, out = (
        {p.relative_to(root): p.read_bytes() for p in root.rglob("*.*")} for root in (tmp_path / "whole", tmp_path / "out")
    )
    assert whole == out
    assert mjs.render(recorded, tmp_path / "out", resume=True, **about).finished == 3


def test_kill_and_resume(recorded, tmp_path):
    """kill -9 at any time: finished episodes stay, and the final files are those of an uninterrupted rendering."""
    words = ["--cameras", "--add-camera", "top=pos=0.5,0,1.6 lookat=0.5,0,0", "--worlds", "1", "--batches", "1"]
    program = [sys.executable, "-m", "mjsense", "render", recorded]
    subprocess.run([*program, tmp_path / "whole", *words], check=True, capture_output=True)
    killed = 0
    for delay in (0.02, 0.15, 0.3):
        process = subprocess.Popen(
            [*program, tmp_path / "out", *words, "--resume"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        house = tmp_path / "out/house_0"
        while process.poll() is None and not house.exists():
            time.sleep(0.005)
        time.sleep(delay)
        process.kill()
        killed += process.wait() == -signal.SIGKILL
        process.communicate()
    assert killed
    subprocess.run([*program, tmp_path / "out", *words, "--resume"], check=True, capture_output=True)
    whole, out = (
        {p.relative_to(root): p.read_bytes() for p in root.rglob("*.*")} for root in (tmp_path / "whole", tmp_path / "out")
    )
    assert whole == out and not (tmp_path / "out/house_0/.recording").exists()


def test_damage_is_noticed(recorded, tmp_path):
    """Flipped bits of the data for replay, and of the model archive, in the recording and in what is made of it."""

    def damaged(path, at):
        data = bytearray(path.read_bytes())
        data[at] ^= 4
        path.write_bytes(data)

    def verify(out):
        done = run_program("verify", str(out))
        return done.returncode, done.stdout

    shutil.copytree(recorded, tmp_path / "data")
    archive, file = next((tmp_path / "data").glob("house_0/*.zip")), next((tmp_path / "data").glob("house_0/*.h5"))
    whole = archive.read_bytes()
    damaged(archive, len(whole) // 2)
    assert (code := verify(tmp_path / "data"))[0] == 1 and f"'{archive.name}' is damaged: its checksum is" in code[1]
    archive.write_bytes(whole[: len(whole) // 2])
    assert (code := verify(tmp_path / "data"))[0] == 1 and f"'{archive.name}' is damaged" in code[1]
    with pytest.raises(ValueError, match=f"{archive.name} cannot be read: "):
        mjs.render(tmp_path / "data", tmp_path / "out")
    with pytest.raises(ValueError, match=f"{archive.name} cannot be read: "):
        mjs.check_replay(tmp_path / "data")
    archive.unlink()
    assert (code := verify(tmp_path / "data"))[0] == 1 and "the model archive, which replay needs" in code[1]
    archive.write_bytes(whole)
    assert verify(tmp_path / "data")[0] == 0
    with h5py.File(file) as opened:
        at = opened["traj_1/replay/state"].id.get_chunk_info(0).byte_offset
    damaged(file, at + 50)
    assert (code := verify(tmp_path / "data"))[0] == 1 and "traj_1/replay/state" in code[1]
    with pytest.raises(ValueError, match="replay/state"):
        mjs.render(tmp_path / "data", tmp_path / "out")


@pytest.mark.parametrize("lost", ["replay/state", "obs/extra/tcp_pose", "obs/sensor_data/wrist_camera"])
def test_a_missing_stream_that_was_carried_over_is_noticed(recorded, tmp_path, lost):
    """Also in a rendering of a rendering. Streams of cameras that were left out are not missing."""
    mjs.render(recorded, tmp_path / "first", cameras=["wrist_camera"], add_cameras={"top": TOP}, episodes=[0])
    mjs.render(tmp_path / "first", tmp_path / "second", cameras=["wrist_camera"])
    for name in ("first", "second"):
        verified(tmp_path / name)
        with changed(file_of(tmp_path / name)) as file:
            del file[f"traj_0/{lost}"]
        done = run_program("verify", str(tmp_path / name))
        assert done.returncode == 1 and f"has no '{lost}'" in done.stdout.replace("obs/extra/wrist_camera", "obs/sensor_data/wrist_camera"), done.stdout
        shutil.rmtree(tmp_path / "first", ignore_errors=True)


def test_gaps_between_episode_numbers(tmp_path):
    """Failed attempts are not in a recording; the numbers of the others stay."""
    mjs.record("pick", out=tmp_path / "data", **{**RECORDING, "episodes": 4})
    mjs.render(tmp_path / "data", tmp_path / "some", cameras=[], add_cameras={"top": TOP}, episodes=[3, 1])
    mjs.render(tmp_path / "some", tmp_path / "again", cameras=[])
    verified(tmp_path / "again")
    assert [(e.index, e.number) for e in mjs.Dataset(tmp_path / "again").episodes] == [(0, 1), (1, 3)]


def test_two_houses(tmp_path):
    for house in (0, 3):
        mjs.record("pick", out=tmp_path / "data", house=house, **{**RECORDING, "episodes": 1, "seed": house})
    made = mjs.render(tmp_path / "data", tmp_path / "out", sensors=lambda: [Height()])
    assert [path.name for path in made.paths] == ["house_0", "house_3"]
    verified(tmp_path / "out")
    assert videos(tmp_path / "out") == videos(tmp_path / "data") and "obs/extra/height" in mjs.Dataset(tmp_path / "out").streams
    with pytest.raises(ValueError, match="has 2 houses: pass a function that makes the sensors"):
        mjs.render(tmp_path / "data", tmp_path / "other", sensors=[Height()])


def test_errors(recorded, tmp_path):
    out = tmp_path / "out"
    for options, message in (
        (dict(cameras=["wrist_camra"]), "no camera named 'wrist_camra'; did you mean 'wrist_camera'"),
        (dict(add_cameras={"top": {"pos": (0, 0, 1)}}), "camera 'top' needs pos, and either lookat or quat; given: pos"),
        (dict(add_cameras={"top": {**TOP, "fov": 3}}), "camera 'top' has no 'fov'; did you mean 'fovy'"),
        (dict(add_cameras={"top": {**TOP, "pos": (1, 2)}}), r"camera 'top': pos is \(1, 2\); it must be 3 numbers"),
        (dict(add_cameras={"top": {**TOP, "body": "hand"}}), "hand"),
        (dict(add_cameras={"wrist_camera": TOP}), "two cameras are named 'wrist_camera'"),
        (dict(camera_system="droit"), "droid"),
        (dict(brightness=0.0), "brightness is 0: must be above 0"),
        (dict(num_worlds=0), "worlds is 0: must be at least 1"),
        (dict(sensors=[mjs.ContactSensorCfg(name="c", primary=mjs.ContactMatch("body", "robot_0/base"), track_air_time=True)]),
         "sensor 'c' depends on the physics steps between observations"),
        (dict(edit=lambda spec: spec.worldbody.add_body(name="b", mass=1, inertia=[1, 1, 1]).add_freejoint()), "An edit must not add joints, actuators or bodies"),
    ):  # fmt: skip
        with pytest.raises((ValueError, KeyError), match=message):
            mjs.render(recorded, out, **options)
    with pytest.raises(ValueError, match="is that of the recording; choose another one"):
        mjs.render(recorded, recorded)
    mjs.record("pick", out=tmp_path / "bare", replay=False, **RECORDING)
    with pytest.raises(ValueError, match="has no data for replay"):
        mjs.render(tmp_path / "bare", out)
    # Only options that a rendering has are proposed.
    with pytest.raises(ValueError, match="already contains recorded trajectories; resume it, or choose another directory"):
        mjs.render(recorded, tmp_path / "bare")


def test_program(recorded, tmp_path):
    def run(*words):
        return run_program(*map(str, words))

    done = run(
        "render",
        recorded,
        tmp_path / "out",
        "--cameras",
        "--add-camera",
        "top=pos=0.5,0,1.6 lookat=0.5,0,0 width=32 height=24 depth",
        "--episodes",
        0,
    )
    assert done.returncode == 0 and done.stdout.startswith("1 episode with 18 images in "), done.stdout + done.stderr
    assert mjs.Dataset(tmp_path / "out").episodes[0].video("top_depth").shape == (9, 24, 32)
    wrong = run("render", recorded, tmp_path / "out2", "--add-camera", "top=pos=0.5,0")
    assert wrong.returncode == 2 and wrong.stderr.startswith("mjsense: ") and wrong.stderr.count("\n") == 1
    (tmp_path / "s.toml").write_text('[[sensors]]\nkind = "contct"\nname = "x"\n')
    wrong = run("render", recorded, tmp_path / "out2", "--sensors", tmp_path / "s.toml")
    assert wrong.returncode == 2 and "unknown kind 'contct'; did you mean 'contact'?" in wrong.stderr


def test_a_task_in_python(tmp_path):
    """Its cameras are rendered and compared; its other sensors need the task."""
    task = tasks.Cart()
    about = dict(episodes=2, keep_failures=True, horizon=5, num_worlds=2, width=32, height=24, depth=True)
    mjs.record(task, policy=tasks.Driver(task), out=tmp_path / "data", **about)
    mjs.render(tmp_path / "data", tmp_path / "out", copy=False, add_cameras={"top": {"pos": (0, 0, 2), "lookat": (0, 0, 0)}})
    verified(tmp_path / "out")
    made = videos(tmp_path / "out")
    assert {name: data for name, data in made.items() if "top" not in name} == videos(tmp_path / "data") and len(made) == 6
    for root, reason in (
        ("data", "belongs to the task 'cart', which is written in Python"),
        ("out", "carried over from the recording that was rendered"),
    ):
        report = mjs.check_replay(tmp_path / root, states=True)
        check = report.episodes[1].sensors
        assert report and {"obs/sensor_data/side", "obs/sensor_data/side_depth", "obs/sensor_param/side/intrinsic_cv"} <= set(
            check.equal
        ), report
        assert check.not_computed["rewards"] == check.not_computed["obs/agent/qpos"] == reason


def test_sensors_from_states(recorded, tmp_path):
    """Every stream that follows from model and state is computed again, bit for bit."""
    report = mjs.check_replay(recorded, actions=False, states=True)
    assert report, report
    check = report.episodes[0].sensors
    assert {"obs/sensor_data/wrist_camera", "obs/sensor_data/wrist_camera_depth", "obs/extra/wrist_camera_segmentation", "obs/agent/qpos",
            "obs/extra/tcp_pose", "env_states/articulations/franka"} <= set(check.equal)  # fmt: skip
    assert check.not_computed["actions/joint_pos"] == "the action that the policy chose"
    assert check.not_computed["obs/extra/policy_phase"] == "belongs to the policy, or to a sensor that the caller passed"
    assert len(check.equal) > 3 * len(check.not_computed)
    made = json.loads(json.dumps(report.to_dict()))
    assert made["ok"] and made["episodes"][0]["sensors"]["equal"] == check.equal
    shutil.copytree(recorded, tmp_path / "data")
    with changed(file_of(tmp_path / "data")) as file:
        rows = file["traj_1/obs/extra/tcp_pose"]
        pose = rows[3]
        pose[1] = np.nextafter(pose[1], np.float32(2))
        rows[3] = pose
        rows = file["traj_1/obs/agent/qpos"]
        text = json.loads(rows[2].tobytes().rstrip(b"\0"))
        text["arm"][2] += 1
        rows[2] = np.frombuffer(
            json.dumps(text, sort_keys=True, separators=(",", ":")).encode().ljust(rows.shape[1], b"\0"), np.uint8
        )
    wrong = mjs.check_replay(tmp_path / "data", states=True)
    assert not wrong and wrong.episodes[0].ok
    found = wrong.episodes[1].deviations
    assert set(found) == {"obs/extra/tcp_pose", "obs/agent/qpos"}
    assert (found["obs/extra/tcp_pose"].step, found["obs/extra/tcp_pose"].element, found["obs/extra/tcp_pose"].count) == (
        3,
        "value [1]",
        1,
    )
    assert (found["obs/agent/qpos"].step, found["obs/agent/qpos"].element) == (2, "key 'arm'")
