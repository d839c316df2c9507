# SPDX-License-Identifier: Apache-2.0
"""Runs situations in which mjlab's sensors are wrong with mjlab and with mjsense's backend="warp", and prints a table of the
results.

pip install mjlab==1.6.0 --no-deps              # it asks for mujoco_warp 3.11; it works with 4.0
python bench/warp_defects.py [--device cuda:0]
"""

from __future__ import annotations

import argparse
import contextlib
import io
from collections.abc import Callable
from typing import Any

import mjlab.sensor as theirs
import mujoco
import numpy as np
import torch
import warp as wp
from mjlab.entity import EntityCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import Simulation, SimulationCfg

import mjsense as mjs

TRUNK = '<body name="trunk" pos="0 0 {z}"><freejoint/><geom name="trunk" size=".05" group="3"/><site name="imu"/></body>'
SHELL = '<asset><mesh name="shell" vertex="-1 -1 -1 1 -1 -1 -1 1 -1 1 1 -1 -1 -1 1 1 -1 1 -1 1 1 1 1 1"/></asset>'


class Worlds:
    """The same model and sensors in either program."""

    def __init__(
        self, ours: bool, device: str, body: str, *sensors: Any, head: str = "", ground: str = "", spec_fn: Any = None
    ) -> None:
        def spec() -> mujoco.MjSpec:
            return mujoco.MjSpec.from_string(f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>")

        def floor(world: mujoco.MjSpec) -> None:
            if ground:
                world.attach(
                    mujoco.MjSpec.from_string(f"<mujoco><worldbody>{ground}</worldbody></mujoco>"),
                    frame=world.worldbody.add_frame(),
                )

        self.ours = ours
        if ours:
            cfg = mjs.SceneCfg(entities={"robot": mjs.EntityCfg(spec)}, sensors=sensors, spec_fn=floor)
            self.sim: Any = mjs.Simulation(mjs.Scene(cfg), 1, backend="warp", device=device)
            self.scene: Any = self.sim.scene
        else:
            self.scene = Scene(
                SceneCfg(num_envs=1, entities={"robot": EntityCfg(spec_fn=spec)}, sensors=sensors, spec_fn=floor), device=device
            )
            self.sim = Simulation(num_envs=1, cfg=SimulationCfg(), model=self.scene.compile(), device=device)
            self.scene.initialize(self.sim.mj_model, self.sim.model, self.sim.data)
            if self.scene.sensor_context is not None:
                self.sim.set_sensor_context(self.scene.sensor_context)
            self.refresh()

    def refresh(self) -> None:
        """Makes sensors those of the state, as a step of mjlab's environments does."""
        self.sim.forward()
        if not self.ours and self.scene.sensor_context is not None:
            self.sim.sense()

    def qpos(self) -> Any:
        return self.sim.qpos if self.ours else self.sim.data.qpos

    def read(self, name: str, field: str = "") -> np.ndarray:
        data = self.scene[name].data
        return (getattr(data, field) if field else data).cpu().numpy()


def classes(ours: bool) -> Any:
    return mjs if ours else theirs


def down(ours: bool, kind: str, **options: Any) -> Any:
    """A sensor of one ray downwards from the trunk."""
    c = classes(ours)
    frame, pattern = c.ObjRef(type="body", name="trunk", entity="robot"), c.GridPatternCfg(size=(0.0, 0.0), resolution=0.1)
    return getattr(c, kind)(name="ray", frame=frame, pattern=pattern, **options)


def stale_contacts(ours: bool, device: str) -> str:
    c = classes(ours)
    feet = c.ContactSensorCfg(
        name="feet",
        primary=c.ContactMatch(mode="body", pattern="trunk", entity="robot"),
        fields=("found", "force"),
        reduce="netforce",
    )
    worlds = Worlds(ours, device, TRUNK.format(z=0.04), feet, ground='<geom type="plane" size="0 0 1"/>')
    before = worlds.read("feet", "found").item()
    worlds.qpos()[:, 2] = 1.0
    worlds.refresh()
    return f"found {before:g}, then {worlds.read('feet', 'found').item():g}"


def rangefinder(ours: bool, device: str) -> str:
    c = classes(ours)
    finder = c.BuiltinSensorCfg(name="finder", sensor_type="rangefinder", obj=c.ObjRef(type="site", name="imu", entity="robot"))
    worlds = Worlds(ours, device, TRUNK.format(z=1), finder, ground='<geom type="box" size="9 9 .1" pos="0 0 2.1"/>')
    return f"{worlds.read('robot/finder').item():.3f} m"


def same_names(ours: bool, device: str) -> str:
    Worlds(
        ours,
        device,
        TRUNK.format(z=1),
        *(down(ours, "RayCastSensorCfg", max_distance=far) for far in (1.0, 2.0)),
        ground='<geom type="plane" size="0 0 1"/>',
    )
    return "no error"


def inside_a_mesh(ours: bool, device: str) -> str:
    mesh = '<geom type="mesh" mesh="shell" contype="0" conaffinity="0"/>'
    worlds = Worlds(ours, device, TRUNK.format(z=0) + mesh, down(ours, "RayCastSensorCfg", exclude_parent_body=True), head=SHELL)
    return f"{worlds.read('ray', 'distances').item():.3f} m"


def sunken_ground(ours: bool, device: str) -> str:
    ground = '<geom type="plane" size="0 0 1" pos="0 0 -3"/>'
    worlds = Worlds(ours, device, TRUNK.format(z=0.5), down(ours, "TerrainHeightSensorCfg", max_distance=2.0), ground=ground)
    return f"{worlds.read('ray', 'heights').item():.3f} m"


def far_plane(ours: bool, device: str) -> str:
    worlds = Worlds(ours, device, TRUNK.format(z=1), down(ours, "RayCastSensorCfg"), ground='<geom type="plane" size="0 0 1"/>')
    worlds.qpos()[:, 0] = 1500.0
    worlds.refresh()
    return f"{worlds.read('ray', 'distances').item():.3f} m"


def unnamed_sensor(ours: bool, device: str) -> str:
    head = '<sensor><gyro site="imu"/></sensor>'
    Worlds(ours, device, TRUNK.format(z=1), head=head)
    return "works"


def unnamed_geoms(ours: bool, device: str) -> str:
    c = classes(ours)
    match = c.ContactMatch(mode="geom", pattern=".*", entity="robot")
    body = TRUNK.format(z=0.04).replace("<site", '<geom size=".04" pos=".1 0 0"/><geom size=".04" pos="-.1 0 0"/><site')
    worlds = Worlds(ours, device, body, c.ContactSensorCfg(name="all", primary=match), ground='<geom type="plane" size="0 0 1"/>')
    return f"{worlds.read('all', 'found').shape[1]} primaries"


def groups_of_cameras(ours: bool, device: str) -> str:
    c = classes(ours)
    options: dict[str, Any] = {
        "pos": (0, 0, 3),
        "quat": (1, 0, 0, 0),
        "width": 3,
        "height": 3,
        "data_types": ("depth",),
        "enabled_geom_groups": (0,),
    }
    camera = c.CameraSensorCfg(name="above", **options)
    worlds = Worlds(
        ours,
        device,
        TRUNK.format(z=1),
        camera,
        down(ours, "RayCastSensorCfg", include_geom_groups=(0, 3)),
        ground='<geom type="plane" size="0 0 1"/>',
    )
    return f"depth {worlds.read('above', 'depth')[0, 1, 1, 0]:.2f} m"


def two_settings(ours: bool, device: str) -> str:
    c = classes(ours)
    cameras = [c.CameraSensorCfg(name=f"c{i}", width=4, height=4, use_shadows=bool(i)) for i in range(2)]
    Worlds(ours, device, TRUNK.format(z=1), *cameras, ground='<geom type="plane" size="0 0 1"/>')
    return "works"


SITUATIONS: dict[str, tuple[Callable[[bool, str], str], str]] = {
    "Contact data after the state was written and `forward()`: the ball no longer touches the plane": (
        stale_contacts,
        "found 1, then 0",
    ),
    "`BuiltinSensorCfg` of a rangefinder, 1 m below a ceiling": (rangefinder, "1.000 m"),
    "Two ray sensors of one name": (same_names, "an error"),
    "A ray from the centre of a mesh, 1 m from its faces": (inside_a_mesh, "1.000 m"),
    "Height above ground at z = -3 m, which is out of reach (2 m), of a frame at z = 0.5 m": (sunken_ground, "2.000 m"),
    "A ray to an endless plane 1 m below, 1,500 m from its origin": (far_plane, "1.000 m"),
    "An XML sensor without a name": (unnamed_sensor, "works"),
    "`ContactMatch` with `.*` where two of three geoms have no name": (unnamed_geoms, "works"),
    "A camera that sees group 0, next to a ray sensor that hits groups 0 and 3; a ball of group 3 is in between": (
        groups_of_cameras,
        "depth 3.00 m",
    ),
    "Two cameras, one with shadows": (two_settings, "works"),
}


def result(situation: Callable[[bool, str], str], ours: bool, device: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            return situation(ours, device)
        except Exception as error:
            return f"{type(error).__name__}: {str(error).strip().splitlines()[0][:80] if str(error) else ''}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu", help="cpu, cuda:0 and so on.")
    device = parser.parse_args().device
    wp.config.quiet = True
    torch.set_num_threads(1)
    print("| situation | correct | mjlab | mjsense |\n| --- | --- | --- | --- |")
    for text, (situation, correct) in SITUATIONS.items():
        print(f"| {text} | {correct} | {result(situation, False, device)} | {result(situation, True, device)} |", flush=True)


if __name__ == "__main__":
    main()
