# SPDX-License-Identifier: Apache-2.0
"""Runs the cells of a notebook with mjsense.Renderer as mujoco.Renderer, and compares its images with those of MuJoCo's.

    python notebook.py NOTEBOOK PSNR [CHECKOUT...]

Cells see the checkouts (folders of repositories that the notebook clones) in their working directory, and run even if an earlier one has
failed. Ends with an error if a cell fails that does not fail with MuJoCo's renderer, or if an image differs.
"""

import json
import os
import re
import sys
import tempfile
import traceback
import types
from pathlib import Path

from images import end, require_opengl

require_opengl()
import mujoco
from compared import THEIRS, Compared


def stub(name, **members):
    """A module whose functions do nothing."""
    module = types.ModuleType(name)
    module.__getattr__ = lambda member: (lambda *args, **kwargs: None)
    module.__dict__.update({"__path__": [], **members})
    sys.modules[name] = module
    return module


def prepare():
    """What notebooks import in order to show images."""
    import matplotlib
    import pygments.formatters
    import pygments.lexers  # noqa: F401

    matplotlib.use("Agg")
    stub("google")
    colab = stub("google.colab", files=None, output=stub("google.colab.output"))
    sys.modules["google"].colab = colab
    stub("mediapy")
    distutils = stub("distutils")
    distutils.util = stub("distutils.util")


def code_of(source):
    """The cell without commands of the shell and of IPython, and without tests of the machine's GPU."""
    source = re.sub(r"^(\s*)[!%].*$", r"\1pass", source, flags=re.M)
    source = re.sub(r"^if subprocess.run\('nvidia-smi'\).returncode:.*?(?=^\S)", "", source, flags=re.M | re.S)
    return re.sub(r"^NVIDIA_ICD_CONFIG_PATH = .*?^\"\"\"\)\n", "", source, flags=re.M | re.S)


def run(cells, renderer, names):
    """Runs the cells, and returns the errors by cell."""
    mujoco.Renderer = renderer
    errors = {}
    for number, cell in enumerate(cells):
        Compared.cell = number
        try:
            exec(compile(code_of(cell), f"cell {number}", "exec"), names)
        except BaseException as error:
            errors[number] = "".join(traceback.format_exception_only(error)).strip()[:300]
            print(f"cell {number} with {renderer.__module__}: {errors[number]}", flush=True)
    return errors


def main():
    notebook, psnr, checkouts = Path(sys.argv[1]).resolve(), float(sys.argv[2]), sys.argv[3:]
    cells = ["".join(c["source"]) for c in json.loads(notebook.read_text())["cells"] if c["cell_type"] == "code"]
    with tempfile.TemporaryDirectory() as folder:
        for checkout in checkouts:
            os.symlink(Path(checkout).resolve(), Path(folder, Path(checkout).name))
        os.chdir(folder)
        prepare()
        ours = run(cells, Compared, {"__name__": "__main__"})
        theirs = run(cells, THEIRS, {"__name__": "__main__"}) if ours else {}
        os.chdir("/")
    for number, quality in sorted(Compared.worst.items()):
        print(f"cell {number}: {quality:.1f} dB")
    print(f"{len(cells)} cells, {Compared.images} images compared")
    assert not ours.keys() - theirs.keys(), "cells fail with mjsense.Renderer only"
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
