# SPDX-License-Identifier: Apache-2.0
"""Time of mjlab's sensors on the CPU: 64 Go1 on rough terrain, IMU and feet as in bench/contact.py.

The scene is mjlab's own: Scene and Simulation on the device "cpu", its Go1 held by its actuators, four of its rough terrains, its
physics (mujoco_warp, whose kernels are compiled in the first run, which takes about a minute). The last line of the output is a
JSON object with CPU microseconds of one thread per world and substep:

    physics           Simulation.step in the scene without the feet's sensors; includes the IMU's sensordata, as in
                      bench/contact.py
    sensors           increase of Simulation.step with the feet's sensors, because mujoco_warp fills their sensordata
    torch             update of all sensors at every substep, and reading feet and IMU at every fourth
    feet_in_contact   share of the feet in contact at the end, to check that the robots stand

mjlab's history holds force, torque and dist.
"""

import json
import statistics
import time

import torch
import warp as wp
from mjlab.asset_zoo.robots.unitree_go1.go1_constants import get_go1_robot_cfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg
from mjlab.sim import Simulation, SimulationCfg
from mjlab.terrains import TerrainEntityCfg, TerrainGeneratorCfg
from mjlab.terrains.config import ROUGH_TERRAINS_CFG

WORLDS, DECIMATION, WARMUP, ROUNDS = 64, 4, 25, 20
FIELDS = ("found", "force", "torque", "dist", "pos", "normal", "tangent")
KINDS = ("random_rough", "pyramid_stairs", "hf_pyramid_slope", "wave_terrain")


def feet() -> ContactSensorCfg:
    primary = ContactMatch(mode="geom", pattern=".*_foot_collision", entity="robot")
    return ContactSensorCfg(name="feet", primary=primary, fields=FIELDS, track_air_time=True, history_length=DECIMATION)


class Case:
    def __init__(self, sensors: tuple) -> None:
        kinds = {kind: ROUGH_TERRAINS_CFG.sub_terrains[kind] for kind in KINDS}
        tiles = TerrainGeneratorCfg(
            seed=0, size=(8.0, 8.0), border_width=5.0, num_rows=2, num_cols=4, curriculum=True, sub_terrains=kinds
        )
        terrain = TerrainEntityCfg(terrain_type="generator", terrain_generator=tiles)
        cfg = SceneCfg(num_envs=WORLDS, terrain=terrain, entities={"robot": get_go1_robot_cfg()}, sensors=sensors)
        self.scene = Scene(cfg, "cpu")
        self.sim = Simulation(WORLDS, SimulationCfg(nconmax=64, njmax=600), spec=self.scene.spec, device="cpu")
        self.scene.initialize(self.sim.mj_model, self.sim.model, self.sim.data)
        self.read = [self.scene[f"robot/imu_{s}"] for s in ("ang_vel", "lin_vel", "lin_acc")]
        self.read += [self.scene[s.name] for s in sensors]
        self.dt = self.sim.mj_model.opt.timestep
        self.stand()
        self.physics: list[float] = []  # s of each round
        self.torch: list[float] = []

    def stand(self) -> None:
        """Puts each robot on its terrain tile, in the pose that its actuators hold."""
        robot = self.scene["robot"]
        state = robot.data.default_root_state.clone()
        state[:, :3] += self.scene.env_origins
        robot.write_root_state_to_sim(state)
        robot.write_joint_state_to_sim(robot.data.default_joint_pos, robot.data.default_joint_vel)
        robot.set_joint_position_target(robot.data.default_joint_pos)
        self.scene.write_data_to_sim()

    def run(self) -> None:
        physics = sensing = 0.0
        for substep in range(DECIMATION):
            start = time.process_time()
            self.sim.step()
            wp.synchronize()
            middle = time.process_time()
            for sensor in self.scene.sensors.values():
                sensor.update(self.dt)
            if substep == DECIMATION - 1:
                for sensor in self.read:
                    sensor.data
            physics += middle - start
            sensing += time.process_time() - middle
        self.physics.append(physics)
        self.torch.append(sensing)


def main() -> None:
    torch.set_num_threads(1)
    cases = without, with_feet = Case(()), Case((feet(),))
    for _ in range(WARMUP + ROUNDS):
        for case in cases:
            case.run()
    us = 1e6 / WORLDS / DECIMATION
    added = [b - a for a, b in zip(without.physics[WARMUP:], with_feet.physics[WARMUP:])]
    print(
        json.dumps(
            {
                "physics": us * statistics.median(without.physics[WARMUP:]),
                "sensors": us * statistics.median(added),
                "torch": us * statistics.median(with_feet.torch[WARMUP:]),
                "feet_in_contact": float((with_feet.scene["feet"].data.found > 0).float().mean()),
            }
        )
    )


if __name__ == "__main__":
    main()
