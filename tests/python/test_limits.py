# SPDX-License-Identifier: Apache-2.0
"""Requests that exceed a limit or are impossible raise one clear error."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs


@pytest.fixture
def sim():
    return mjs.Simulation(ball_scene(), num_worlds=4, decimation=5)


def test_too_many_worlds():
    with pytest.raises(ValueError, match=r"num_worlds is 2000000000: they need .* GB of memory, but only .* GB are available"):
        mjs.Simulation(ball_scene(), num_worlds=2_000_000_000)


def test_too_many_threads():
    with pytest.raises(ValueError, match="threads is 100000: must be 0"):
        mjs.Simulation(ball_scene(), threads=100_000)


def in_child(body):
    """Output and exit status of a forked child."""
    end, begin = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(end)
        try:
            body()
            said = "nothing"
        except BaseException as error:
            said = f"{type(error).__name__}: {error}"
        os.write(begin, said.encode())
        os._exit(0)
    os.close(begin)
    deadline = time.time() + 20
    while os.waitpid(pid, os.WNOHANG)[0] == 0:
        if time.time() > deadline:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            pytest.fail("the child hangs")
        time.sleep(0.02)
    return os.read(end, 10_000).decode()


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_fork(sim):
    sim.step()
    assert "after the fork" in in_child(sim.step)
    assert in_child(sim.close) == "nothing"
    sim.step()  # the parent still works


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_simulation_of_a_forked_child():
    def body():
        mjs.Simulation(ball_scene(), num_worlds=3).step()

    mjs.Simulation(ball_scene(), num_worlds=3).step()
    assert in_child(body) == "nothing"


def test_child_of_a_fork_ends():
    code = (
        "import os, sys\nimport mjsense as mjs\nfrom scenes import ball_scene\nsim = mjs.Simulation(ball_scene(), num_worlds=4, threads=3)\n"
        "sim.step()\npid = os.fork()\nif pid == 0:\n    sys.exit(3)\nprint(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n"
    )
    here = str(Path(__file__).parent)
    path = os.pathsep.join([here, *sys.path])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env={**os.environ, "PYTHONPATH": path})
    assert done.stdout.strip() == "3", done.stderr


def test_interrupt(sim, request):
    """Ctrl-C reaches a long call of step()."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job begins without it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    at = []  # process CPU time at which the signal was sent: independent of the load of the machine

    def interrupt():
        at.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.3, interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        sim.step(50_000_000)
    assert time.process_time() - at[0] < 0.5


def test_no_log_file_is_written(sim, tmp_path, monkeypatch):
    """MuJoCo warns of a world that diverges, on the terminal, and writes no file into the user's folder."""
    monkeypatch.chdir(tmp_path)
    sim.qpos[1].flat[0] = np.nan
    sim.step()
    assert sim.failures
    plain = mujoco.MjData(sim.model)
    plain.qpos[:] = np.nan
    mujoco.mj_step(sim.model, plain)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["qpos", "qvel", "ctrl", "mocap_pos", "xfrc_applied"])
def test_bad_state_is_reported_by_forward(name):
    scene = mjs.Scene(mjs.SceneCfg(base="<mujoco><worldbody><body name='m' mocap='true'><geom size='.1'/></body>"
                                        "<body pos='0 0 1'><joint name='h' axis='0 1 0'/><geom size='.1' pos='.2 0 0'/></body></worldbody>"
                                        "<actuator><motor joint='h'/></actuator></mujoco>"))  # fmt: skip
    sim = mjs.Simulation(scene, num_worlds=3)
    getattr(sim, name)[1].flat[0] = np.nan
    sim.forward()
    assert [f[0] for f in sim.failures] == [1] and name in sim.failures[0][1]
    assert np.isfinite(sim.state if hasattr(sim, "state") else sim.qpos).all()
    sim.forward()
    assert not sim.failures


# ---- randomize


def fields_of_mjxmacro():
    """Every array of mjModel: {name: C type}."""
    header = Path(mujoco.HEADERS_DIR) / "mjxmacro.h"
    text = header.read_text().split("#define MJMODEL_POINTERS", 1)[1].split("#define MJDATA", 1)[0]
    return {name: kind for kind, name in re.findall(r"^\s*X\w*\s*\(\s*(\w+)\s*,\s*(\w+)\s*,", text, re.MULTILINE)}


def test_lists_of_fields_equal_mujoco():
    from mjsense.scene import randomizable

    fields = fields_of_mjxmacro()
    assert len(fields) > 300
    for name in randomizable._WHOLE:
        assert fields[name] in ("int", "mjtByte", "mjtBool"), name
    for name in randomizable._FIXED:
        assert fields[name] in ("mjtNum", "float"), name


def test_structure_cannot_be_randomized(sim):
    """Every array of the model is tried: structural arrays are rejected, and the simulation still works after every accepted one."""
    refused = 0
    for name, kind in fields_of_mjxmacro().items():
        like = getattr(sim.model, name, None)
        if not isinstance(like, np.ndarray) or like.size == 0:
            continue
        whole = kind not in ("mjtNum", "float")
        try:
            sim.randomize(name, like)
        except ValueError:
            refused += 1
            continue
        if whole:
            from mjsense.scene import randomizable

            assert name in randomizable._WHOLE
    sim.step()
    assert refused > 50


@pytest.mark.parametrize("field", ["body_dofnum", "dof_bodyid", "B_colind", "jnt_type", "geom_bodyid", "body_parentid"])
def test_fields_that_crashed(sim, field):
    with pytest.raises(ValueError, match=f"{field}: part of the model's structure"):
        sim.randomize(field, 7)


@pytest.mark.parametrize("field, value, message", [
    ("geom_condim", 2, "must be 1, 3, 4 or 6"),
    ("geom_type", 7, "cannot be given here"),
    ("geom_dataid", 5, "ids of meshes"),
])
def test_invalid_values_are_rejected(sim, field, value, message):
    with pytest.raises(ValueError, match=message):
        sim.randomize(field, value)
