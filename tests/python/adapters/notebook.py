# SPDX-License-Identifier: Apache-2.0
"""Runs the cells of a notebook with the images of mjsense, and compares them with those of the packages that the notebook uses.

    python notebook.py mujoco|dm_control|mujoco_warp NOTEBOOK PSNR [CHECKOUT...]

mujoco: mjsense.Renderer is mujoco.Renderer. dm_control, mujoco_warp: after mjsense.compat.PACKAGE.use(); states are compared, too. Cells see the checkouts (folders of
repositories that the notebook clones) in their working directory, and run even if an earlier one has failed. Simulated times and numbers of
frames are a tenth of the notebook's. Lines for the shell and for IPython are left out and listed. Ends with an error if a cell fails that
does not fail with the packages' own images, or if an image differs.
"""

import contextlib
import json
import os
import re
import sys
import tempfile
import time
import traceback
import types
from pathlib import Path

from images import end, require_opengl

require_opengl()
import mujoco
import numpy as np
from compared import EACH, FIRST, THEIRS, Compared, quality_of

import mjsense


def stub(name, **members):
    """A module whose functions do nothing."""
    module = types.ModuleType(name)
    module.__getattr__ = lambda member: (lambda *args, **kwargs: None)
    module.__dict__.update({"__path__": [], **members})
    sys.modules[name] = module
    return module


def prepare():
    """What notebooks import in order to show images."""
    os.environ["COLAB_NOTEBOOK_TEST"] = "1"  # dm_control's makes no videos then
    with contextlib.suppress(ImportError):  # mujoco_warp's needs neither
        import matplotlib
        import pygments.formatters
        import pygments.lexers  # noqa: F401

        matplotlib.use("Agg")
    with contextlib.suppress(ImportError):
        import google.protobuf  # noqa: F401  # dm_control's soccer uses it
    if "google" not in sys.modules:
        stub("google")
    colab = stub("google.colab", files=None, output=stub("google.colab.output"))
    sys.modules["google"].colab = colab
    stub("mediapy")
    distutils = stub("distutils")
    distutils.util = stub("distutils.util")


def code_of(source):
    """The cell without commands of the shell and of IPython, and without tests of the machine's GPU; a tenth as long."""
    source = re.sub(r"^(\s*)[!%].*$", r"\1pass", source, flags=re.M)
    source = re.sub(r"^(\s*(?:duration|n_seconds) *= *)([\d.]+)", lambda m: f"{m[1]}{float(m[2]) / 10}", source, flags=re.M)
    source = re.sub(r"^(\s*n_frames *= *)(\d+)", lambda m: f"{m[1]}{max(2, int(m[2]) // 10)}", source, flags=re.M)
    source = re.sub(r"range\(3 \* 60\)", "range(18)", source)
    source = re.sub(r"^if subprocess.run\('nvidia-smi'\).returncode:.*?(?=^\S)", "", source, flags=re.M | re.S)
    return re.sub(r"^NVIDIA_ICD_CONFIG_PATH = .*?^\"\"\"\)\n", "", source, flags=re.M | re.S)


def run(cells, what, after=lambda names: None):
    """Runs the cells, and returns the errors by cell. `after`: called after each cell, with its variables."""
    names = {"__name__": "__main__"}
    np.random.seed(0)
    errors = {}
    for number, cell in enumerate(cells):
        Compared.cell = number
        try:
            exec(compile(code_of(cell), f"cell {number}", "exec"), names)
            after(names)
        except BaseException as error:
            errors[number] = "".join(traceback.format_exception_only(error)).strip()[:300]
            print(f"cell {number} {what}: {errors[number]}", flush=True)
    return errors


def run_mujoco(cells):
    """The errors with both renderers; those with MuJoCo's only if there are some with mjsense's."""
    mujoco.Renderer = Compared
    ours = run(cells, "with mjsense")
    mujoco.Renderer = THEIRS
    return ours, run(cells, "without mjsense") if ours else {}


def run_dm_control(cells):
    """The errors with the images of mjsense, and with dm_control's own."""
    from dm_control.mujoco import engine

    images = []

    def keep():
        """Keeps the first images of each cell and some of the others, by cell and number."""
        found, count = {}, {}
        for owner in (engine.Physics, engine.Camera):

            def render(self, *args, _own=owner.render, **kwargs):
                image = _own(self, *args, **kwargs)
                number = count[Compared.cell] = count.get(Compared.cell, 0) + 1
                if number <= FIRST or number % EACH == 0:
                    found[Compared.cell, number] = image.copy()
                return image

            owner.render = render
        images.append(found)

    own = engine.Physics.render, engine.Camera.render
    keep()
    theirs = run(cells, "without mjsense")
    engine.Physics.render, engine.Camera.render = own
    from mjsense.compat import dm_control

    dm_control.use()
    keep()
    ours = run(cells, "with mjsense")
    assert images[0].keys() == images[1].keys() or ours.keys() - theirs.keys(), "cells have made other numbers of images"
    for (cell, number), image in images[1].items():
        if (cell, number) in images[0]:
            Compared.images += 1
            Compared.worst[cell] = min(Compared.worst.get(cell, 99), quality_of(image, images[0][cell, number]))
    return ours, theirs


def run_mujoco_warp(cells):
    """The errors with the functions of mjsense, and with mujoco_warp's own."""
    import mediapy
    import warp

    from mjsense.compat import mujoco_warp

    warp.set_device("cpu")
    mujoco.Renderer = mjsense.Renderer  # faster, and the same in both
    found = []
    for context, what in ((contextlib.nullcontext(), "without mjsense"), (mujoco_warp.used(), "with mjsense")):
        images, states, seconds = {}, {}, {}

        def show(image, *_, images=images, **__):
            images.setdefault(Compared.cell, []).extend(image if isinstance(image, list) else [image])

        def keep(names, states=states, seconds=seconds):
            seconds[Compared.cell] = time.process_time()
            if isinstance(qpos := getattr(names.get("data"), "qpos", None), warp.array):
                states[Compared.cell] = qpos.numpy().copy()

        mediapy.show_video = mediapy.show_image = show
        with context:
            errors = run(cells, what, keep)
        found.append((errors, images, states, seconds))
    (theirs, images, states, seconds), (ours, our_images, our_states, our_seconds) = found
    assert images.keys() == our_images.keys() and states.keys() == our_states.keys(), "cells have shown other images"
    for cell, pictures in images.items():
        for image, other in zip(our_images[cell], pictures, strict=True):
            Compared.images += 1
            same = quality_of(image, other) if image.dtype == np.uint8 else 99 * np.isclose(image, other, atol=1e-3).all(-1).mean()
            Compared.worst[cell] = min(Compared.worst.get(cell, 99), same)
    for cell, qpos in states.items():
        print(f"cell {cell}: {len(qpos)} worlds, positions differ by at most {np.abs(our_states[cell] - qpos).max():.1e}")
        np.testing.assert_allclose(our_states[cell], qpos, atol=1e-4)
    for cell in [*seconds][1:]:
        spent = (one[cell] - one[cell - 1] for one in (seconds, our_seconds))
        print(f"cell {cell}: {next(spent):.2f} s of CPU time with mujoco_warp's own kernels, {next(spent):.2f} s with mjsense")
    return ours, theirs


def main():
    package, notebook, psnr, checkouts = sys.argv[1], Path(sys.argv[2]).resolve(), float(sys.argv[3]), sys.argv[4:]
    cells = ["".join(c["source"]) for c in json.loads(notebook.read_text())["cells"] if c["cell_type"] == "code"]
    for number, cell in enumerate(cells):
        for line in re.findall(r"^\s*([!%].*)$", cell, flags=re.M):
            print(f"cell {number}, left out: {line}")
    with tempfile.TemporaryDirectory() as folder:
        for checkout in checkouts:
            os.symlink(Path(checkout).resolve(), Path(folder, Path(checkout).name))
        os.chdir(folder)
        prepare()
        runs = {"mujoco": run_mujoco, "dm_control": run_dm_control, "mujoco_warp": run_mujoco_warp}
        ours, theirs = runs[package](cells)
        os.chdir("/")
    for number, quality in sorted(Compared.worst.items()):
        print(f"cell {number}: {quality:.1f} dB")
    print(f"{len(cells)} cells, {Compared.images} images compared")
    assert not ours.keys() - theirs.keys(), "cells fail with mjsense only"
    assert Compared.images, "no image"
    assert min(Compared.worst.values()) >= psnr, "an image differs"


try:
    main()
except BaseException:
    traceback.print_exc()
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(1)
end()
