# SPDX-License-Identifier: Apache-2.0
"""Cost of mjsense.attach and mjsense.RecordEpisodes for a program that steps its own data or environment, in CPU time.

./dev python bench/existing_programs.py     (needs mujoco 4.0)
"""

import statistics
import tempfile
import time
from collections.abc import Callable

import gymnasium
import mujoco

import mjsense as mjs


def microseconds(call: Callable[[], object], count: int) -> float:
    """Median of seven measurements of ``count`` calls."""
    found = []
    for _ in range(7):
        begun = time.process_time()
        for _ in range(count):
            call()
        found.append((time.process_time() - begun) / count * 1e6)
    return statistics.median(found)


def attach() -> None:
    scene = mjs.Scene(
        mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")}, terrain=mjs.TerrainCfg())
    )
    model = mujoco.MjModel.from_xml_string(scene.to_xml())
    data = mujoco.MjData(model)
    sensors = (
        mjs.ContactSensorCfg(
            name="feet", fields=("found", "force"), primary=mjs.ContactMatch(mode="geom", pattern=r".*_foot", entity="robot")
        ),
        mjs.ImuSensorCfg(name="imu", site=mjs.ObjRef(type="site", name="imu", entity="robot")),
    )
    with mjs.attach(model, data, sensors=sensors) as attached:

        def update() -> None:
            mujoco.mj_step(model, data)
            attached.update()
            for name in ("feet", "imu"):
                _ = attached[name].data

        step = microseconds(lambda: mujoco.mj_step(model, data), 2000)
        attached.reset()
        both = microseconds(update, 2000)
    print(
        f"attach, quadruped with contacts and IMU: update {both - step:.0f} us, mj_forward "
        f"{microseconds(lambda: mujoco.mj_forward(model, data), 2000):.0f} us"
    )


def record_episodes() -> None:
    def run(env: gymnasium.Env, steps: int) -> float:
        begun = time.process_time()
        for t in range(steps):
            if t % 200 == 0:
                env.reset(seed=t)
            env.step(env.action_space.sample())
        return (time.process_time() - begun) / steps * 1e6

    steps = 4000
    alone = statistics.median(run(gymnasium.make("Pendulum-v1"), steps) for _ in range(3))
    costs = []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as out:
            env = mjs.RecordEpisodes(gymnasium.make("Pendulum-v1"), out, episodes=steps // 200)
            costs.append(run(env, steps))
            env.close()
    print(
        f"RecordEpisodes, Pendulum-v1, episodes of 200 steps: {statistics.median(costs) - alone:.0f} us per step, "
        "with the files of its episodes"
    )


if __name__ == "__main__":
    attach()
    record_episodes()
