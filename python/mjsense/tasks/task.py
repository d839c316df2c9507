# SPDX-License-Identifier: Apache-2.0
"""Tasks written in Python: a scene, the start of an episode, and its evaluation."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import mujoco_names
from mjsense.core.arguments import checked
from mjsense.core.arrays import on_host
from mjsense.core.errors import did_you_mean
from mjsense.scene.scene import prepared
from mjsense.scene.written_values import numbers, write_component
from mjsense.sensors.given_sensor import list_of_sensors
from mjsense.tasks import gymnasium_registry

if TYPE_CHECKING:
    import mujoco

    from mjsense.sensors.configs import SceneCfg
    from mjsense.sim.simulation import Simulation


class Task:
    """Base class of user-defined tasks. Implement ``scene`` and ``evaluate``, and override other methods as needed. One call
    evaluates all worlds.

    Life cycle: ``scene()`` once, ``initialize(sim)`` once; for every episode ``sample(rng, world)``, then ``begin(ids)`` when the
    world shows the sampled state; then, and after every control step, ``evaluate(sim)``. Shapes: ``B`` worlds.

    >>> class Reach(mjs.Task): ...
    >>> mjs.record(Reach(), robot="franka", policy=my_policy, out="data")
    >>> env = mjs.make_vec(Reach(), robot="franka", num_envs=64)
    """

    name: str = ""
    """Name in files and messages; by default the class's name in snake case."""
    task_type: str = ""
    """``task_type`` of ``obs_scene`` in files; by default the name."""
    horizon: int = 500
    """Number of control steps after which an episode is truncated."""
    policy_dt_ms: int | None = None
    """Control period, ms; None: the robot's, or 66 without a robot."""
    ctrl_dt_ms: int | None = None
    """Period of the robot's controllers, ms; None: the robot's, or ``sim_dt_ms`` without a robot."""
    sim_dt_ms: int | None = None
    """Physics timestep, ms; None: the robot's, or 2 without a robot."""
    robot: str | None = None
    """Default robot of the task; None: the scene contains the robot."""
    robot_entity: str = "robot"
    """Name of the robot's entity if the scene contains the robot; "": all actuators of the scene belong to it."""
    move_groups: Mapping[str, str | Sequence[str]] = {}
    """Move groups of such a robot: group name -> names (regular expressions) of its actuators. Empty: one group, ``joints``, with
    all actuators. An action consists of their controls."""
    cameras: Mapping[str, str] = {}
    """Cameras of the scene that are observed in addition to the robot's: name -> the model's camera."""
    objects: Mapping[str, str] | Callable[[int], Mapping[str, str]] = {}
    """Objects with a role in the task: role -> body, the main object first. A method ``objects(world)`` may return them per
    episode; the roles must always be the same."""
    graspable: Sequence[str] = ()
    """Bodies that the planner may perceive and grasp; its target is the first of ``objects``."""
    table_height: float = 0.0
    """Height of the surface that they stand on, m."""

    # Set before initialize().
    sim: Simulation
    """The simulation."""
    num_worlds: int
    """Number of worlds, ``B``."""
    action_groups: dict[str, slice]
    """Columns of an action by move group."""

    _mjs_own: Sequence[Any] = ()
    _mjs_found: tuple[Any, ...] | None = None  # what evaluate() returned

    # -------------------------------------------------------------------------------------------- to be implemented or overridden

    def scene(self) -> SceneCfg:
        """Returns the scene without the robot that the task is played with, which is added as the entity ``robot_0``."""
        raise NotImplementedError(f"{type(self).__name__}: write scene()")

    def initialize(self, sim: Simulation) -> None:
        """Called once after compilation: resolve names and allocate memory here."""

    def sample(self, rng: np.random.Generator, world: WorldState) -> Any:
        """Writes the initial state of an episode into ``world``, whose state is the scene's ``init_state``.

        Draw random numbers from ``rng``, which depends only on the seed and the episode's number.

        Returns:
            Pose of the robot's base in the world frame, position (m) and quaternion (wxyz) ``[7]``; None: it is not moved.
        """

    def begin(self, ids: np.ndarray) -> None:
        """Called when new episodes start in these worlds and ``self.sim`` shows their initial states."""

    def evaluate(self, sim: Simulation) -> Any:
        """Evaluates the current state of all worlds.

        Inactive worlds may be in any state, and the results for them are ignored. A method with the signature ``evaluate(sim,
        ids)`` also receives the worlds that are evaluated, each once per observation.

        Returns:
            ``(reward, success)``, both ``[B]``, or a dict with ``reward``, ``success`` and optionally ``terminated`` ``[B]`` (the
            episode is over) and ``info``: name -> numbers ``[B]`` or ``[B, k]``, which are stored as ``task_info``.
        """
        raise NotImplementedError(f"{type(self).__name__}: write evaluate(sim)")

    def description(self, world: int) -> str:
        """Instruction in natural language; by default the first line of the class's docstring."""
        own = type(self).__doc__
        return own.strip().split("\n")[0] if own else self._mjs_name()

    def referrals(self, world: int) -> Mapping[str, Sequence[tuple[str, float]]]:
        """Referring expressions for the objects: role -> (text, probability) each."""
        return {role: [(body.split("/")[-1], 1.0)] for role, body in self._mjs_roles(world).items()}

    def scene_info(self, world: int) -> Mapping[str, str]:
        """Additional texts for ``obs_scene``."""
        return {}

    def sensors(self) -> Iterable[Any]:
        """Additional sensors for observations and recordings of this task."""
        return ()

    def suite(self, names: list[str]) -> Sequence[str] | None:
        """Names of the suite's sensors to keep, in order; None: all of them."""
        return None

    # --------------------------------------------------------------------------------------------------------- reading

    def get_info(self) -> list[dict[str, Any]]:
        """``task_info`` of every world at the current observation, without ``episode_step``."""
        if self._mjs_found is None:
            raise RuntimeError(f"task '{self._mjs_name()}': nothing was evaluated yet")
        _, success, _, info = self._mjs_columns(self._mjs_found)
        rows: list[dict[str, Any]] = [{"success": bool(value)} for value in success]
        for key, (kind, width, values) in (info or {}).items():
            cast = {"b": bool, "i": int, "f": float}[kind]
            for row, value in zip(rows, values):
                row[key] = [cast(v) for v in value] if width else cast(value[0])
        return rows

    # ------------------------------------------------------------------------------- called by mjsense (the C++ adapter)

    def _mjs_name(self) -> str:
        return self.name or snake_case(type(self).__name__)

    def _mjs_settings(self) -> dict[str, Any]:
        name = self._mjs_name()
        if not isinstance(self.robot_entity, str):
            raise TypeError(f"task '{name}': robot_entity must be a str, not {self.robot_entity!r}")
        groups = [(group, [p] if isinstance(p, str) else list(p)) for group, p in dict(self.move_groups).items()]
        return {
            "name": name,
            "task_type": self.task_type or name,
            "horizon": self.horizon,
            "policy_dt_ms": self.policy_dt_ms,
            "ctrl_dt_ms": self.ctrl_dt_ms,
            "sim_dt_ms": self.sim_dt_ms,
            "robot_entity": self.robot_entity,
            "move_groups": groups,
            "cameras": list(dict(self.cameras).items()),
            "table_height": float(self.table_height),
        }

    def _mjs_scene(self) -> tuple[Any, ...]:
        return prepared(self.scene, "scene()")

    def _mjs_bind(self, sim: Simulation, layout: list[tuple[str, list[float], list[float]]]) -> None:
        taken = getattr(self, "sim", None)
        if taken is not None and not taken.closed and taken is not sim:
            raise RuntimeError(f"task '{self._mjs_name()}' is played already: make one for each environment")
        self.sim, self.num_worlds = sim, sim.num_worlds
        self.action_groups = group_slices(layout)
        self._mjs_found = None
        self._mjs_ids = takes_ids(self.evaluate)
        self.initialize(sim)

    def _mjs_roles(self, world: int) -> dict[str, str]:
        objects = self.objects
        return dict(objects(world) if callable(objects) else objects)

    def _mjs_graspable(self) -> list[str]:
        return list(self.graspable)

    def _mjs_sample(self, world: int, episode: int, seed: int, states: Any = None) -> list[float] | None:
        """``states``: arrays of all worlds that are written instead of those of the simulation."""
        base = self.sample(episode_rng(seed, episode, "task"), WorldState(states or self.sim, world, episode))
        if base is None:
            return None
        return [float(x) for x in np.asarray(base, dtype=np.float64).reshape(-1)]

    def _mjs_begin(self, ids: list[int]) -> None:
        self.begin(np.array(ids))

    def _mjs_evaluate(self, ids: list[int]) -> tuple[Any, ...]:
        return self._mjs_columns(self._mjs_ask(np.array(ids)))

    def _mjs_ask(self, ids: np.ndarray) -> tuple[Any, ...]:
        """(reward, success, terminated, info) as evaluate() returns them."""
        found = self.evaluate(self.sim, ids) if self._mjs_ids else self.evaluate(self.sim)  # type: ignore[call-arg]
        terminated = info = None
        if isinstance(found, Mapping):
            unknown = set(found) - {"reward", "success", "terminated", "info"}
            if unknown or "reward" not in found or "success" not in found:
                raise ValueError(
                    f"returned a dict of {sorted(found)}; it needs reward and success, and may have terminated and info"
                )
            reward, success, terminated, info = found["reward"], found["success"], found.get("terminated"), found.get("info")
        elif isinstance(found, tuple) and len(found) == 2:
            reward, success = found
        else:
            raise TypeError(f"must return (reward, success), each [B], or a dict of them, not {found!r}")
        self._mjs_found = reward, success, terminated, info
        return self._mjs_found

    def _mjs_columns(self, found: tuple[Any, ...]) -> tuple[Any, ...]:
        reward, success, terminated, info = found
        return (
            self._mjs_column("reward", reward, np.float64),
            self._mjs_column("success", success, np.bool_),
            np.zeros(self.num_worlds, bool) if terminated is None else self._mjs_column("terminated", terminated, np.bool_),
            None if info is None else self._mjs_info(info),
        )

    def _mjs_column(self, what: str, value: Any, dtype: Any) -> np.ndarray:
        array = on_host(value)
        if array.shape != (self.num_worlds,):
            raise ValueError(f"{what} has shape {array.shape}, expected ({self.num_worlds},): one value a world")
        return np.ascontiguousarray(numbers(what, array), dtype=dtype)

    def _mjs_info(self, info: Mapping[str, Any]) -> dict[str, tuple[str, int, np.ndarray]]:
        columns = {}
        for key, value in info.items():
            array = on_host(value)
            if array.dtype.kind not in "biuf" or array.ndim not in (1, 2) or array.shape[0] != self.num_worlds:
                raise ValueError(
                    f"info '{key}' is {array.dtype}{list(array.shape)}; expected numbers [{self.num_worlds}] or "
                    f"[{self.num_worlds}, k]"
                )
            kind = "i" if array.dtype.kind == "u" else array.dtype.kind
            width = array.shape[1] if array.ndim == 2 else 0
            columns[key] = kind, width, np.ascontiguousarray(array.reshape(self.num_worlds, -1), dtype=np.float64)
        return columns

    def _mjs_description(self, world: int) -> str:
        return self.description(world)

    def _mjs_referrals(self, world: int) -> dict[str, list[tuple[str, float]]]:
        return {role: [(str(text), float(p)) for text, p in texts] for role, texts in self.referrals(world).items()}

    def _mjs_scene_info(self, world: int) -> dict[str, str]:
        return dict(self.scene_info(world))

    def _mjs_make_sensors(self) -> list[Any]:
        self._mjs_own = list_of_sensors(self.sensors())  # kept here: C++ refers to them without keeping them alive
        return self._mjs_sensors()

    def _mjs_sensors(self) -> list[Any]:
        return list(self._mjs_own)

    def _mjs_suite(self, names: list[str]) -> list[str] | None:
        wanted = self.suite(names)
        return None if wanted is None else list(wanted)


@checked
class WorldState:
    """The state of one world at the start of an episode, to be written by the task. Names are those of the model:
    ``"mug/mug"``."""

    def __init__(self, sim: Any, world: int, episode: int) -> None:
        self._sim = sim
        self.id = world
        """Id of the world. The episode must not depend on it."""
        self.episode = episode
        """Number of the episode."""

    @property
    def model(self) -> mujoco.MjModel:
        """A copy of the model for look-ups."""
        return self._sim.model

    @property
    def qpos(self) -> np.ndarray:
        """Joint positions ``[nq]``, live."""
        return self._sim.qpos[self.id]

    @property
    def qvel(self) -> np.ndarray:
        """Joint velocities ``[nv]``, live."""
        return self._sim.qvel[self.id]

    @property
    def ctrl(self) -> np.ndarray:
        """Controls ``[nu]``, live."""
        return self._sim.ctrl[self.id]

    @property
    def mocap_pos(self) -> np.ndarray:
        """Positions of mocap bodies ``[nmocap, 3]`` m, live."""
        return self._sim.mocap_pos[self.id]

    @property
    def mocap_quat(self) -> np.ndarray:
        """Orientations of mocap bodies ``[nmocap, 4]`` wxyz, live."""
        return self._sim.mocap_quat[self.id]

    def place(
        self, body: str, pos: Sequence[float], quat: Sequence[float] = (1, 0, 0, 0), velocity: Sequence[float] | None = None
    ) -> None:
        """Sets the pose of a free or mocap body.

        Args:
            body: Name of the body.
            pos: Position of its frame in the world, m ``[3]``.
            quat: Orientation, wxyz ``[4]``.
            velocity: Velocity of a free body ``[6]``: linear in world axes, m/s, then angular in body axes, rad/s; by default 0.
        """
        model = self.model
        index = mujoco_names.known_id(model, mujoco_names.Obj.BODY, body, "place")
        mocap = model.body_mocapid[index]
        if mocap >= 0:
            _write(f"place: pos of '{body}'", self.mocap_pos[mocap], pos)
            _write(f"place: quat of '{body}'", self.mocap_quat[mocap], quat)
            return
        joint = model.body_jntadr[index]
        if joint < 0 or model.jnt_type[joint] != mujoco_names.Joint.FREE:
            raise ValueError(f"place: body '{body}' is neither free nor a mocap body")
        address, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        _write(f"place: pos of '{body}'", self.qpos[address : address + 3], pos)
        _write(f"place: quat of '{body}'", self.qpos[address + 3 : address + 7], quat)
        _write(f"place: velocity of '{body}'", self.qvel[dof : dof + 6], 0 if velocity is None else velocity)

    def set_joint(self, joint: str, value: float | Sequence[float], velocity: float | Sequence[float] = 0.0) -> None:
        """Sets a joint's position (rad or m; 7 values for a free joint) and velocity."""
        index = mujoco_names.known_id(self.model, mujoco_names.Obj.JOINT, joint, "set_joint")
        positions, velocities = mujoco_names.rows_of_joint(self.model, index)
        _write(f"set_joint: value of '{joint}'", self.qpos[positions], value)
        _write(f"set_joint: velocity of '{joint}'", self.qvel[velocities], velocity)


def _write(what: str, target: np.ndarray, value: Any) -> None:
    """Writes finite numbers to a part of the state."""
    write_component(what, target, value)
    if not np.isfinite(target).all():
        raise ValueError(f"{what}: must be finite, not {value!r:.100}")


def snake_case(name: str) -> str:
    """PushCube -> push_cube"""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def takes_ids(function: Callable[..., Any]) -> bool:
    """Whether evaluate() or reset() takes the world ids as a second argument."""
    import inspect

    return len(inspect.signature(function).parameters) > 1


def group_slices(layout: list[tuple[str, list[float], list[float]]]) -> dict[str, slice]:
    """Columns of an action by move group."""
    slices, start = {}, 0
    for name, low, _ in layout:
        slices[name] = slice(start, start + len(low))
        start += len(low)
    return slices


def episode_rng(seed: int, episode: int, stream: str) -> np.random.Generator:
    """Random number generator of an episode; a function of the arguments only."""
    return np.random.default_rng([seed, episode, *stream.encode()])


_TASKS: dict[str, Callable[[], Task]] = {}


def register_task(name: str, make: Callable[[], Task]) -> None:
    """Registers a user-defined task, so that ``mjs.record(name)`` and ``mjs.make_vec(name)`` find it.

    Args:
        name: A name that is not in use.
        make: The task class, or a function that returns a task.
    """
    if name in task_names():
        raise ValueError(f"a task named '{name}' is already registered")
    if not name or not callable(make):
        raise TypeError(f"register_task: {name!r} must be a name and {make!r} a class or a function")
    _TASKS[name] = make
    gymnasium_registry.register(name)


def task_names() -> list[str]:
    """Names of all tasks, registered ones last."""
    return [*_core.task_names(), *_TASKS]


def task_of(task: Any) -> tuple[str, Task | None]:
    """Returns (name for messages and files, the object if the task is written in Python)."""
    if isinstance(task, str):
        if task not in _TASKS:
            return task, None
        task = _TASKS[task]
    if isinstance(task, type) or (callable(task) and not isinstance(task, Task)):
        task = task()
    if not isinstance(task, Task):
        raise TypeError(f"task must be a mjsense.Task or the name of one ({', '.join(task_names())}), not {task!r}")
    if type(task).evaluate is Task.evaluate:
        own = [name for name in dir(task) if name[0] != "_" and name not in dir(Task)]
        raise TypeError(
            f"{type(task).__name__} has no method evaluate(sim), which returns reward and success{did_you_mean('evaluate', own)}"
        )
    return task._mjs_name(), task
