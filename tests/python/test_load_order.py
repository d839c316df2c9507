# SPDX-License-Identifier: Apache-2.0
"""Works together with libraries that bring their own HDF5, Embree or libstdc++, in any load order."""

import importlib.util
import itertools
import subprocess
import sys

import pytest

OTHERS = [name for name in ("h5py", "torch", "scipy", "rerun") if importlib.util.find_spec(name) is not None]
ORDERS = [order for n in (2, 3) for others in itertools.combinations(OTHERS, n - 1) for order in itertools.permutations(("mjsense", *others))]

USE = """
import importlib, sys, tempfile, pathlib
for name in sys.argv[1:]:
    importlib.import_module(name)
import h5py, numpy as np, mjsense as mjs
with tempfile.TemporaryDirectory() as folder:
    own = pathlib.Path(folder) / "own.h5"
    with h5py.File(own, "w") as file:
        file.create_dataset("x", data=np.arange(10000.0), compression="gzip")
    mjs.record("pick", out=folder + "/data", episodes=1, horizon=2, keep_failures=True, width=32, height=24)
    with h5py.File(next(pathlib.Path(folder).rglob("traj*.h5"))) as file:
        assert len(file) > 0
    with h5py.File(own) as file:
        assert file["x"][-1] == 9999
    if "torch" in sys.argv:
        import torch
        assert torch.ones(300, 300).mm(torch.ones(300, 300))[0, 0] == 300
"""


@pytest.mark.parametrize("order", ORDERS, ids="-".join)
def test_load_order(order):
    run = subprocess.run([sys.executable, "-W", "ignore", "-c", USE, *order], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr


def test_nothing_is_exported():
    """The extension exports no symbols that another library could bind to by mistake."""
    from mjsense import _core

    symbols = subprocess.run(["nm", "-D", "--defined-only", _core.__file__], capture_output=True, text=True, check=True).stdout.split("\n")
    ours = {line.split()[-1] for line in symbols if line.split()[1:2] in (["T"], ["D"], ["B"], ["R"])}
    assert not {name for name in ours if name.startswith(("H5", "rtc", "pcre2", "inflate", "deflate", "mj"))}, ours
