# SPDX-License-Identifier: Apache-2.0
"""``backend="warp"``: the simulation and the environments on mujoco_warp, which is imported when one is made."""

from __future__ import annotations

from functools import partial
from typing import Any

from mjsense.core import libmujoco
from mjsense.core.arguments import Seed, checked
from mjsense.scene.scene import Scene
from mjsense.sim.simulation import Simulation


def _module(name: str) -> Any:
    """A module of this room. Raises ImportError, with the extra, if mujoco_warp is not installed or is of another series."""
    import importlib.metadata  # slow to import

    try:
        found = importlib.metadata.version("mujoco-warp")
    except importlib.metadata.PackageNotFoundError:
        found = ""  # the import below says what is missing
    series = ".".join(map(str, libmujoco.SERIES))
    if found and not found.startswith(f"{series}."):
        raise ImportError(
            f"backend='warp' needs mujoco-warp {series}, and {found} is installed, with {libmujoco.installed()}: "
            "pip install \"mjsense[warp]\" (in another environment if a package needs the installed one), or use backend='cpu'"
        )
    try:
        return importlib.import_module(f"mjsense.warp.{name}")
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in ("warp", "mujoco_warp", "mujoco"):
            raise
        raise ImportError(f"backend='warp' needs {error.name}: pip install \"mjsense[warp]\"") from None


@partial(checked, context="Simulation()")
def simulation(
    scene: Scene,
    num_worlds: int | None = None,
    decimation: int = 1,
    threads: int = 0,
    seed: Seed = 0,
    *,
    device: str | None = None,
    nconmax: int | None = None,
    njmax: int | None = None,
) -> Any:
    """The simulation of this scene on mujoco_warp."""
    warp = _module("simulation")
    if scene._simulation is not None:
        raise RuntimeError("this scene belongs to a simulation already: make another with Scene(scene.cfg)")
    if threads:
        raise ValueError("Simulation(): threads is for backend='cpu'")
    compiled = Simulation._compiled(scene, decimation, seed)
    sim = warp.WarpSimulation(compiled, scene.cfg.num_envs if num_worlds is None else num_worlds, device, nconmax, njmax)
    scene._simulation = compiled._core
    return sim


def environment(*arguments: Any) -> Any:
    """The environments of a task on mujoco_warp, for :func:`mjsense.make_vec`."""
    return _module("rollout").WarpTaskVectorEnv(*arguments)
