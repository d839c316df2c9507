# SPDX-License-Identifier: Apache-2.0
"""Running out of memory, also because of the sizes in a model, raises an error: the process survives."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense

SMALL = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
HOSTILE = SMALL.replace("<worldbody>", '<size nuser_geom="2000000000"/><worldbody>')
CHILD = """
import resource, sys
import mjsense as mjs
pages = int(open("/proc/self/statm").read().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + int(sys.argv[1]),) * 2)
try:
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(entities={"a": mjs.EntityCfg(model=sys.argv[2])})), num_worlds=2)
except (RuntimeError, ValueError, MemoryError) as error:
    print("raised", error)
else:
    print("made")
"""


# MuJoCo alone takes 15 MB for a world: too little for the compiler, for a world, for two.
@pytest.mark.parametrize("megabytes", [1, 8, 40, 100])
def test_too_little_memory_is_an_error(tmp_path, megabytes):
    said = run(tmp_path, SMALL, megabytes * 1_000_000)
    assert "memory" in said or "address space" in said


# A std::bad_alloc inside libmujoco, which no C++ code outside of it can catch.
def test_size_larger_than_memory_is_an_error(tmp_path):
    assert "scene: MuJoCo ran out of memory, or a size in the model is too large" in run(tmp_path, HOSTILE, 3_000_000_000)


def test_the_program_ends_with_an_error(tmp_path):
    model = tmp_path / "model.xml"
    model.write_text(HOSTILE)
    program = Path(mjsense.__file__).parents[2] / "mjsense"
    if not program.is_file():
        pytest.skip("the program is not in the package's folder")
    done = subprocess.run(
        [program, "sensors", model],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000,) * 2),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 2
    assert "MuJoCo ran out of memory" in done.stderr


def run(folder, xml, bytes_left):
    model = folder / "model.xml"
    model.write_text(xml)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(bytes_left), str(model)], env=os.environ, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("raised ")
    return done.stdout


STARVED = """
import resource
import gymnasium, numpy as np
import mjsense as mjs

class Greedy(mjs.Sensor):
    uuid = "greedy"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)

    def compute(self, sim):
        return np.ones((2, 10**9 if greedy else 1), np.float32)[:, :1]

greedy = False
sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base="%s", sensors=(Greedy(),))), num_worlds=2)
sim.step()
sim.scene["greedy"].data
resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000,) * 2)
greedy = True
for k in range(3):
    try:
        sim.step()
        sim.scene["greedy"].data
    except RuntimeError as error:
        print("raised", error)
greedy = False
sim.step()
print(sim.scene["greedy"].data.tolist(), sim.time.tolist())
"""


def test_a_sensor_that_runs_out_of_memory_raises_and_the_simulation_goes_on():
    done = subprocess.run([sys.executable, "-c", STARVED % SMALL], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    *raised, last = done.stdout.splitlines()
    assert len(raised) == 3 and all(line.startswith("raised sensor 'greedy': compute(): MemoryError") for line in raised)
    assert last == "[[1.0], [1.0]] [0.01, 0.01]"
