# SPDX-License-Identifier: Apache-2.0
"""Sensors written for MolmoSpaces: equal rows at any number of worlds, through simulations, environments and recordings."""

import gymnasium
import h5py
import mujoco
import numpy as np
import pytest

import mjsense as mjs

BOX = gymnasium.spaces.Box
SMALL = dict(width=48, height=32, shadows=False, seed=3, horizon=6)


class PeerSensor:
    """The base class that MolmoSpaces' sensors have, which knows nothing of mjsense."""

    is_dict = False
    str_max_len = 2000

    def __init__(self, uuid, observation_space, **kwargs):
        self.uuid, self.observation_space = uuid, observation_space

    def reset(self):
        return None


class Counter(PeerSensor):
    """Counts its observations of an episode."""

    def __init__(self):
        super().__init__("counter", BOX(0, 1e6, (1,), np.float32))
        self.count = 0

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        self.count += 1
        return np.array([self.count], np.float32)

    def reset(self):
        self.count = 0


class RelativeJoints(PeerSensor):
    """Joint positions minus those observed before."""

    def __init__(self):
        super().__init__("relative", BOX(0, 255, (1,), np.uint8))
        self.is_dict = True
        self.before = None

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        view = env.robots[batch_index].robot_view
        assert env.current_robot.robot_view is view
        now = view.get_qpos_dict()
        before, self.before = self.before or now, now
        return {name: (q - before[name]).tolist() for name, q in now.items()}

    def reset(self):
        self.before = None


class Tool(PeerSensor):
    def __init__(self):
        super().__init__("tool", BOX(-np.inf, np.inf, (4, 4), np.float64))

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        view = env.current_robot.robot_view
        return view.get_move_group(view.get_gripper_movegroup_ids()[0]).leaf_frame_to_robot


class Contacts(PeerSensor):
    """Reads the world's mujoco.MjData: contacts and accelerations, which no built-in sensor provides."""

    def __init__(self):
        super().__init__("contacts", gymnasium.spaces.Dict({}))

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        data = env.mj_datas[batch_index]
        geoms = sorted((int(c.geom1), int(c.geom2)) for c in data.contact[: data.ncon])
        return {
            "count": np.array([data.ncon], np.int32),
            "sums": {"geoms": [float(sum(map(sum, geoms)))], "qacc": np.array([np.abs(data.qacc).sum()])},
        }


class Task(PeerSensor):
    def __init__(self):
        super().__init__("about_task", BOX(0, 255, (1,), np.uint8))
        self.is_dict = True

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        action = task.last_action
        return {
            "info": task.get_info()[batch_index],
            "action": None if action is None else {name: np.asarray(a).tolist() for name, a in action.items()},
            "terminal": bool(task.is_terminal()),
            "objects": task.get_task_objects(batch_index),
            "step": task.episode_step_count,
            "start": task.config.task_config.pickup_obj_start_pose,
            "what": task.get_task_description(),
        }


class Dice(PeerSensor):
    """Draws from NumPy's global generator, as MolmoSpaces' image points do."""

    def __init__(self):
        super().__init__("dice", BOX(0, 1, (2,), np.float64))
        self.bias = 0.0

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        return np.array([np.random.random(), self.bias])

    def reset(self):
        self.bias = np.random.uniform()


class Integral(mjs.Sensor):
    """Time of the episode, from update(dt)."""

    uuid = "integral"
    observation_space = BOX(0, np.inf, (2,), np.float64)

    def __init__(self):
        super().__init__()
        self.time, self.calls = 0.0, 0

    def update(self, dt):
        self.time += dt
        self.calls += 1

    def get_observation(self, env, task, batch_index=0):
        return np.array([self.time, self.calls])

    def reset(self):
        self.time, self.calls = 0.0, 0


class BatchIntegral(mjs.Sensor):
    """The same with one instance for all worlds."""

    uuid = "batch_integral"
    observation_space = BOX(0, np.inf, (2,), np.float64)

    def initialize(self, sim):
        self.rows_ = np.zeros((sim.num_worlds, 2))

    def update(self, dt):
        self.rows_ += [dt, 1]

    def compute(self, sim):
        return self.rows_

    def reset(self, world_ids=None):
        self.rows_[slice(None) if world_ids is None else world_ids] = 0


def sensors():
    return [Counter(), RelativeJoints(), Tool(), Contacts(), Task(), Dice(), Integral(), BatchIntegral()]


NAMES = ["counter", "relative", "tool", "contacts/count", "contacts/sums/geoms", "contacts/sums/qacc", "about_task", "dice",
         "integral", "batch_integral"]  # fmt: skip


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Rows of episodes 0 .. 8 by number of worlds: {B: {episode: {stream: rows}}}."""
    out = {}
    for worlds in (1, 3, 8):
        path = tmp_path_factory.mktemp(f"data{worlds}")
        summary = mjs.record(
            out=path, num_worlds=worlds, episodes=9, keep_failures=True, cameras=[], sensors=sensors(), **SMALL
        )
        assert summary.kept == 9, summary
        out[worlds] = read(path)
    return out


def read(path):
    episodes = {}
    for name in sorted(path.rglob("*.h5")):
        with h5py.File(name) as file:
            for trajectory in file.values():
                episodes[int(trajectory.attrs["episode"])] = {n: trajectory[f"obs/extra/{n}"][()] for n in NAMES}
    return episodes


def test_rows_do_not_depend_on_the_number_of_worlds(recorded):
    one = recorded[1]
    assert sorted(one) == list(range(9))
    for worlds in (3, 8):
        for episode, streams in one.items():
            for name, rows in streams.items():
                np.testing.assert_array_equal(rows, recorded[worlds][episode][name], err_msg=f"{name}, B = {worlds}")


def test_rows_are_right(recorded):
    for streams in recorded[3].values():
        steps = np.arange(len(streams["counter"]))
        np.testing.assert_array_equal(streams["counter"][:, 0], steps + 1)
        for name in ("integral", "batch_integral"):
            np.testing.assert_allclose(streams[name][:, 0], steps * 0.066)
            np.testing.assert_array_equal(streams[name][:, 1], steps)
        assert not np.array_equal(streams["tool"][0], streams["tool"][-1])
        assert len(np.unique(streams["dice"][:, 0])) == len(steps) and len(np.unique(streams["dice"][:, 1])) == 1
        assert (streams["contacts/count"][1:] > 0).all()
        assert b'"action":null' in bytes(streams["about_task"][0]) and b'"action":{' in bytes(streams["about_task"][1])


def test_environment_observations_equal_the_recording(recorded):
    env = mjs.make_vec(num_envs=3, policy="planner", cameras=[], action_noise=True, sensors=sensors(), **SMALL)
    env.reset()
    rows = {w: {name: [env.rows[name][w].copy()] for name in env.rows if name in NAMES} for w in range(3)}
    assert {"counter", "contacts/sums/qacc", "integral"} <= set(rows[0])
    assert env.single_observation_space["contacts"]["sums"]["qacc"].shape == (1,)
    for _ in range(len(recorded[1][0]["counter"]) - 1):
        env.step(env.expert_action())
        for w in range(3):
            for name in rows[w]:
                rows[w][name].append(env.rows[name][w].copy())
    for w in range(3):
        for name, values in rows[w].items():
            expected = recorded[1][w][name]
            # actions pass through float32 or not at all: the first observation is the recording's own
            np.testing.assert_array_equal(values[0], expected[0], err_msg=name)
            if name in ("counter", "dice", "integral", "batch_integral"):
                np.testing.assert_array_equal(values, expected, err_msg=name)
    env.close()


def test_a_suite_of_the_environments_simulation(recorded):
    env = mjs.make_vec(num_envs=3, policy="planner", cameras=[], action_noise=True, **SMALL)
    env.reset()
    suite = mjs.SensorSuite(sensors())
    for step in range(3):
        now = suite.get_observations(env.sim)
        one = suite.get_observations(env.sim, None, 2)
        assert one["counter"] == [step + 1]  # computed once per state, even if it is read several times
        assert list(now) == ["counter", "relative", "tool", "contacts", "about_task", "dice", "integral", "batch_integral"]
        np.testing.assert_array_equal(now["counter"], np.full((3, 1), step + 1))
        np.testing.assert_allclose(now["integral"], np.full((3, 2), [0.066 * step, step]))
        np.testing.assert_array_equal(now["batch_integral"], now["integral"])
        np.testing.assert_array_equal(one["contacts"]["sums"]["qacc"], now["contacts"]["sums"]["qacc"][2])
        assert now["about_task"][1]["step"] == step
        if step == 0:
            for w in range(3):
                np.testing.assert_array_equal(now["tool"][w], recorded[1][w]["tool"][0])
        env.step(env.expert_action())
    env.close()


def test_mj_datas_equal_the_worlds():
    # A scene that is the same in every world, as the model of `fresh` is.
    env = mjs.make_vec(num_envs=2, scene="table", policy="planner", cameras=[], **SMALL)
    env.reset()
    sim, peer = env.sim, env.sim.env
    kept = peer.mj_datas[1]
    for _ in range(3):
        env.step(env.expert_action())
        for w, data in enumerate(peer.mj_datas):
            for name in ("qpos", "qvel", "ctrl", "mocap_pos", "xpos", "xquat", "site_xpos", "qacc", "cvel", "actuator_force"):
                np.testing.assert_array_equal(getattr(data, name), getattr(sim.data, name)[w], err_msg=name)
            # MuJoCo's own functions work on it
            assert data.body("robot_0/base").xpos.shape == (3,)
            fresh = mujoco.MjData(peer.mj_model)
            spec = int(mujoco.mjtState.mjSTATE_INTEGRATION)
            state = np.empty(mujoco.mj_stateSize(peer.mj_model, spec))
            mujoco.mj_getState(peer.mj_model, data, state, spec)
            mujoco.mj_setState(peer.mj_model, fresh, state, spec)
            mujoco.mj_forward(peer.mj_model, fresh)
            assert data.ncon == fresh.ncon
            np.testing.assert_array_equal(data.contact.geom, fresh.contact.geom)
    assert peer.mj_datas[1] is kept
    env.close()


def bodies_in(peer, mask):
    """Bodies that the wrist camera shows where `mask` is true."""
    types, geoms = np.moveaxis(peer.render_segmentation_frame("wrist_camera")[mask], -1, 0)[::-1]
    assert (types == int(mujoco.mjtObj.mjOBJ_GEOM)).all()
    return set(peer.mj_model.geom_bodyid[geoms])


def test_the_robot_view_agrees_with_the_suite():
    env = mjs.make_vec(num_envs=2, policy="planner", cameras=["wrist_camera"], **SMALL)
    env.reset()
    env.step(env.expert_action())
    peer = env.sim.env
    for w in range(2):
        robot = peer.robots[w]
        view = robot.robot_view
        assert view.move_group_ids() == ["base", "arm", "gripper"] and view.get_gripper_movegroup_ids() == ["gripper"]
        for group, q in view.get_qpos_dict().items():
            if q.size:
                np.testing.assert_array_equal(q.astype(np.float32), env.rows[f"qpos/{group}"][w])
        np.testing.assert_allclose(view.base.pose[:3, 3], env.rows["robot_base_pose"][w][:3], atol=1e-6)
        np.testing.assert_allclose(
            view.get_move_group("gripper").leaf_frame_to_robot[:3, 3], env.rows["tcp_pose"][w][:3], atol=1e-6
        )
        jacobian, data = view.get_move_group("arm").get_jacobian(), view.mj_data
        (dofs,) = np.nonzero(np.abs(jacobian).sum(0))
        assert dofs.size == 7
        for dof in dofs:
            joint = view.mj_model.dof_jntid[dof]
            arm = view.get_move_group("arm").leaf_frame_to_world[:3, 3] - data.xanchor[joint]
            np.testing.assert_allclose(jacobian[:3, dof], np.cross(data.xaxis[joint], arm), atol=1e-9)
            np.testing.assert_allclose(jacobian[3:, dof], data.xaxis[joint], atol=1e-9)
        target = robot.last_unnoised_cmd_joint_pos()
        np.testing.assert_array_equal(target["arm"], env.rows["actions/joint_pos/arm"][w])
        pose = robot.kinematics.fk(target, np.eye(4), rel_to_base=True)["arm"]
        np.testing.assert_allclose(pose[:3, 3], env.rows["actions/ee_pose/arm"][w][:3], atol=1e-12)
        peer.current_batch_index = w
        camera = peer.camera_manager.registry["wrist_camera"]
        sensor = mjs.sensors.CameraParameterSensor("wrist_camera", 48, 32, uuid=f"camera{w}")
        env.sim.add(sensor)
        np.testing.assert_allclose(camera.get_pose(), sensor.data["cam2world_gl"][w], atol=1e-12)
        np.testing.assert_array_equal(peer.render_rgb_frame("wrist_camera"), env.rows["wrist_camera"][w])
        mask = peer.get_segmentation_mask_of_object("robot_0/gripper/base", "wrist_camera", w)
        names = {peer.mj_model.body(body).name for body in bodies_in(peer, mask)}
        assert names and all(name.startswith("robot_0/gripper/") for name in names)
    with pytest.raises(ValueError, match="out of range"):
        peer.current_batch_index = 2
    env.close()


def test_with_a_task_written_in_python(tmp_path):
    from tasks import Cart, Driver

    class Mark(PeerSensor):
        """Reads attributes of the user-defined task, and attributes that every task has."""

        def __init__(self):
            super().__init__("mark", BOX(-2, 2, (3,), np.float64))

        def get_observation(self, env, task, batch_index=0, *args, **kwargs):
            assert task.get_task_objects(batch_index) == {"ball": "cart/ball"}
            action = task.last_action
            return np.array([task.mark[batch_index], env.mj_datas[batch_index].qpos[0], 0 if action is None else action["joints"][0]])

    class Marked(Cart):
        def sensors(self):
            return [Mark()]

    rows = {}
    for worlds in (1, 3):
        task = Marked()
        summary = mjs.record(
            task, policy=Driver(task), out=tmp_path / str(worlds), num_worlds=worlds, episodes=3, keep_failures=True, cameras=[]
        )
        rows[worlds] = {}
        for path in summary.path.rglob("*.h5"):
            with h5py.File(path) as file:
                rows[worlds] |= {int(t.attrs["episode"]): t["obs/extra/mark"][()] for t in file.values()}
    for episode, one in rows[1].items():
        np.testing.assert_array_equal(one, rows[3][episode])
        assert len(np.unique(one[:, 0])) == 1 and one[0, 2] == 0 and one[5, 2] != 0 and len(np.unique(one[:, 1])) > 5


def test_plain_simulation_has_no_robot_view():
    from scenes import ball_scene

    sim = mjs.Simulation(ball_scene(), num_worlds=2)
    with pytest.raises(AttributeError, match="knows no robot"):
        sim.env.robots
    with pytest.raises(mjs.SensorError, match=r"sensor 'tool', world 0: get_observation.*knows no robot"):
        sim.add(Tool()).data
    assert sim.env.task is None and sim.env.n_batch == 2
    counter = sim.add(Counter())
    assert counter.original.count == 0
    for step in range(3):
        counter.data, counter.data
        np.testing.assert_array_equal(counter.rows, np.full((2, 1), step + 1))
        sim.step()
    sim.reset([1])
    np.testing.assert_array_equal(counter.data[:, 0], [4, 1])


class Failing(Counter):
    """Fails in episode 1 at its fourth observation."""

    how = "raise"

    def get_observation(self, env, task, batch_index=0, *args, **kwargs):
        row = super().get_observation(env, task, batch_index)
        if env.task.episode_step_count == 3 and env.sim.num_worlds and self.is_first_object(task):
            if self.how == "raise":
                raise ArithmeticError("no number")
            if self.how == "shape":
                return np.zeros(2, np.float32)
            return np.array([-1], np.float32)
        return row

    def is_first_object(self, task):
        return task.config.task_config.pickup_obj_start_pose == self.victim


@pytest.mark.parametrize("how, text", [
    ("raise", "get_observation.*ArithmeticError: no number"),
    ("shape", r"shape \(2,\) is not \(1,\)"),
    ("bounds", r"-1.0 at \[0\] is outside the observation_space's \[0.0, 1000000.0\]"),
])  # fmt: skip
def test_error_rejects_only_its_episode(tmp_path, recorded, how, text):
    import json
    import re

    victim = json.loads(bytes(recorded[1][1]["about_task"][0]).rstrip(b"\0"))["start"]
    kept = {}
    for worlds in (1, 3):
        sensor = Failing()
        sensor.how, sensor.victim = how, victim
        path = tmp_path / str(worlds)
        summary = mjs.record(
            out=path, num_worlds=worlds, episodes=4, keep_failures=True, cameras=[], sensors=[sensor, *sensors()[1:]], **SMALL
        )
        assert summary.kept == 4
        refused = [why for why in summary.failures if why.startswith("sensor")]
        assert len(refused) == 1 and re.search(rf"^sensor 'counter', world \d: .*{text}", refused[0]), summary.failures
        kept[worlds] = read(path)
        assert sorted(kept[worlds]) == [0, 2, 3, 4]
    for episode, streams in kept[1].items():
        for name, rows in streams.items():
            np.testing.assert_array_equal(rows, kept[3][episode][name])
            np.testing.assert_array_equal(rows, recorded[1][episode][name])


def test_recording_that_always_fails_ends(tmp_path):
    class Broken(Counter):
        def get_observation(self, env, task, batch_index=0):
            raise ArithmeticError("no")

    class Long(mjs.Sensor):
        uuid, is_dict, str_max_len = "counter", True, 8

        def compute(self, sim):
            return [{"much": "too long"}] * sim.num_worlds

    for worlds in (1, 2):
        for broken, text in ((Broken(), "ArithmeticError: no"), (Long(), "JSON text of 19 bytes, str_max_len is 8")):
            with pytest.raises(mjs.SensorError, match=f"sensor 'counter', world 0: .*{text}"):
                mjs.record(out=tmp_path, num_worlds=worlds, episodes=2, cameras=[], sensors=[broken], **SMALL)
            assert not list(tmp_path.rglob("*"))
    summary = mjs.record(
        out=tmp_path, num_worlds=2, episodes=2, keep_failures=True, cameras=[], sensors=[Counter()], **SMALL
    )
    assert summary.kept == 2


def test_invalid_sensors_are_rejected(tmp_path):
    for thing, text in ((3, "not a sensor: 3 is not a mjsense.Sensor"), (Counter, "not a sensor but a class")):
        with pytest.raises(TypeError, match=text):
            mjs.record(out=tmp_path, sensors=[thing])
        with pytest.raises(TypeError, match=text):
            mjs.SensorSuite([thing])

    class Locked(Counter):
        def __init__(self):
            super().__init__()
            import threading

            self.lock = threading.Lock()

    with pytest.raises(mjs.SensorError, match=r"'counter': one instance a world is needed, and it cannot be copied.*__deepcopy__"):
        mjs.make_vec(num_envs=2, cameras=[], sensors=[Locked()], **SMALL)
    mjs.make_vec(num_envs=1, cameras=[], sensors=[Locked()], **SMALL).close()


def test_environment_reports_why_an_episode_ended():
    class AtStep(Counter):
        def get_observation(self, env, task, batch_index=0):
            if task.episode_step_count == 2 and batch_index == 1 and env.current_batch_index == 1:
                raise ArithmeticError("no")
            return super().get_observation(env, task, batch_index)

    env = mjs.make_vec(num_envs=3, policy="planner", cameras=[], sensors=[AtStep()], **SMALL)
    env.reset()
    _, _, _, truncated, infos = env.step(env.expert_action())
    assert not truncated.any()
    _, _, _, truncated, infos = env.step(env.expert_action())
    assert truncated.tolist() == [False, True, False]
    assert infos["fault"][1] == "sensor 'counter', world 1: get_observation(): ArithmeticError: no"
    observation, _, _, truncated, _ = env.step(env.expert_action())
    np.testing.assert_array_equal(observation["counter"], [[4], [1], [4]])
    again, _ = env.reset(seed=5)
    np.testing.assert_array_equal(again["counter"], [[1], [1], [1]])
    env.close()
