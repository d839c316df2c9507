# SPDX-License-Identifier: Apache-2.0
"""What 1 and 50 physics steps of mjlab's tasks give with mjsense.compat.mjlab.use(), with mujoco_warp's own kernels on the CPU
and with plain MuJoCo of the environment's version, from the same states and with the same controls.

    build/mjlab/bin/python bench/mjlab_steps.py [TASK ...] [--envs 64] [--page docs/mjlab.md]

An environment makes the states: it takes --warm steps with random actions. The controls of the next 50 physics steps are
recorded, and each of the three then makes these steps with its own data and the same models, randomised by world. Compared are
the arrays that mjlab reads. A number is the difference of a world relative to the largest number of the array: the median over
the worlds of the array that differs most, and the share of worlds of which all arrays differ by less than 1e-3. Not compared is
subtree_com of bodies without mass, which is 0 in mujoco_warp and a position in MuJoCo. --page replaces the rows of the table of
that page. The environment build/mjlab is that of tests/python/test_adapters.py; PYTHONPATH names the folder of the build.
"""

from __future__ import annotations

import argparse
import copy
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

READ = """
    qpos qvel xpos xquat xipos cvel subtree_com site_xpos geom_xpos sensordata qacc actuator_force qfrc_actuator ten_length
    """.split()
"""Arrays that mjlab's entities, sensors and tasks read."""
STATE = "qpos qvel act ctrl qacc_warmstart mocap_pos mocap_quat eq_active xfrc_applied qfrc_applied time".split()
STEPS = (1, 50)
SAME = 1e-3


def standing_motion(task: str) -> str:
    """A file with the motion that the tracking tasks need: the robot stands in its initial pose."""
    import mujoco
    from mjlab.scene import Scene
    from mjlab.tasks.registry import load_env_cfg

    scene = Scene(load_env_cfg(task).scene, device="cpu")
    model, robot = scene.compile(), scene["robot"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    bodies = [model.body(f"robot/{name}").id for name in robot.body_names]
    joints = [model.joint(f"robot/{name}").qposadr[0] for name in robot.joint_names]
    frames = 500
    values = {"joint_pos": data.qpos[joints], "joint_vel": 0 * data.qpos[joints], "body_pos_w": data.xpos[bodies]}
    values |= {
        "body_quat_w": data.xquat[bodies],
        "body_lin_vel_w": 0 * data.xpos[bodies],
        "body_ang_vel_w": 0 * data.xpos[bodies],
    }
    path = Path(tempfile.mkdtemp()) / "motion.npz"
    arrays: dict[str, Any] = {name: np.repeat(value[None], frames, 0).astype(np.float32) for name, value in values.items()}
    np.savez(path, fps=50, **arrays)
    return str(path)


def environment(task: str, envs: int) -> Any:
    from mjlab.envs import ManagerBasedRlEnv
    from mjlab.tasks.registry import load_env_cfg

    cfg = load_env_cfg(task)
    cfg.scene.num_envs, cfg.seed = envs, 1
    if "Tracking" in task:
        cfg.commands["motion"].motion_file = standing_motion(task)
    env = ManagerBasedRlEnv(cfg=cfg, device="cpu")
    env.reset(seed=1)
    return env


def controls(env: Any, steps: int) -> list[np.ndarray]:
    """The controls of the next physics steps of the environment with random actions."""
    import torch

    found: list[np.ndarray] = []
    step = env.sim.step

    def recorded() -> None:
        found.append(env.sim.wp_data.ctrl.numpy().copy())
        step()

    env.sim.step = recorded
    while len(found) < steps:
        env.step(0.3 * torch.randn(env.num_envs, env.action_manager.total_action_dim))
    env.sim.step = step
    return found[:steps]


def by_warp(sim: Any, step: Any, state: dict[str, np.ndarray], ctrl: list[np.ndarray]) -> list[dict[str, np.ndarray]]:
    import mujoco_warp

    data = sim.wp_data
    own = mujoco_warp.put_data(sim.mj_model, sim.mj_data, nworld=data.nworld, nconmax=sim.cfg.nconmax, njmax=sim.cfg.njmax)
    for name, value in state.items():
        getattr(own, name).numpy()[...] = value
    found = []
    for number, values in enumerate(ctrl, 1):
        own.ctrl.numpy()[...] = values
        step(sim.wp_model, own)
        if number in STEPS:
            found.append({name: getattr(own, name).numpy().astype(float).reshape(data.nworld, -1) for name in READ})
    return found


def by_mujoco(sim: Any, state: dict[str, np.ndarray], ctrl: list[np.ndarray]) -> list[dict[str, np.ndarray]]:
    import mujoco

    found: list[dict[str, list[np.ndarray]]] = [{name: [] for name in READ} for _ in STEPS]
    changed = {name: getattr(sim.wp_model, name).numpy() for name in sorted(sim.expanded_fields)}
    derived = ("body_subtreemass", "dof_invweight0", "body_invweight0", "tendon_invweight0", "tendon_length0", "actuator_acc0")
    changed |= {name: getattr(sim.wp_model, name).numpy() for name in derived}
    for world in range(sim.num_envs):
        model = copy.copy(sim.mj_model)
        for name, rows in changed.items():
            target = getattr(model, name)
            if rows.size:
                target[...] = rows[world % len(rows)].reshape(target.shape)
        data = mujoco.MjData(model)
        for name, value in state.items():
            if name == "time":
                data.time = value[world]
            elif value.size:
                target = getattr(data, name)
                target[...] = value[world].reshape(target.shape)
        for number, values in enumerate(ctrl, 1):
            data.ctrl[:] = values[world]
            mujoco.mj_step(model, data)
            if number in STEPS:
                for name in READ:
                    found[STEPS.index(number)][name].append(np.ravel(getattr(data, name)).copy())
    return [{name: np.array(rows) for name, rows in each.items()} for each in found]


def differences(sim: Any, a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> tuple[str, float, float]:
    """The array that differs most, the median of its differences over the worlds, and the share of worlds that are the same."""
    massless = np.repeat(sim.mj_model.body_subtreemass <= 0, 3)
    for each in (a, b):
        each["subtree_com"][:, massless] = 0
    by_field = {
        name: np.abs(a[name] - b[name]).max(1) / max(1e-3, np.abs(a[name]).max())
        for name in READ
        if a[name].size and a[name].shape[1]
    }
    worst = max(by_field, key=lambda name: float(np.median(by_field[name])))
    return worst, float(np.median(by_field[worst])), float(np.mean(np.max([*by_field.values()], 0) < SAME))


def row(task: str, envs: int, warm: int) -> str:
    import torch

    from mjsense.compat import mujoco_warp

    torch.manual_seed(1)
    np.random.seed(1)
    with mujoco_warp.used():
        env = environment(task, envs)
        for _ in range(warm):
            env.step(0.3 * torch.randn(envs, env.action_manager.total_action_dim))
        data = env.sim.wp_data
        state = {name: getattr(data, name).numpy().copy() for name in STATE}
        ctrl = controls(env, STEPS[-1])
        state["xfrc_applied"][...] = 0
        ours = by_warp(env.sim, mujoco_warp._call("step"), state, ctrl)
    theirs, plain = by_warp(env.sim, mujoco_warp._OWN["step"], state, ctrl), by_mujoco(env.sim, state, ctrl)
    cells = []
    for number in range(len(STEPS)):
        for other in (theirs, plain):
            name, median, same = differences(env.sim, other[number], ours[number])
            cells.append(f"{median:.0e} ({name}), {100 * same:.0f} %")
    return f"| {task} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*")
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--warm", type=int, default=10)
    parser.add_argument("--page", type=Path, help="replace the rows of these tasks in its table")
    options = parser.parse_args()

    import warp as wp

    wp.config.log_level = 40
    import mjlab.tasks  # noqa: F401
    from mjlab.tasks.registry import list_tasks

    for task in options.tasks or list_tasks():
        line = row(task, options.envs, options.warm)
        print(line, flush=True)
        if options.page:
            text = options.page.read_text()
            new = re.sub(rf"^\| {task} \| \S+ \(.*$", lambda _, line=line: line, text, flags=re.MULTILINE)
            options.page.write_text(new)


if __name__ == "__main__":
    main()
