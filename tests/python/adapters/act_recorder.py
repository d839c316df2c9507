# SPDX-License-Identifier: Apache-2.0
"""ACT's recorder of simulated episodes, with a call of mjsense.compat.dm_control.use() before it, compared with its own images.

    python act_recorder.py CHECKOUT

CHECKOUT is a folder with ACT's repository. Episodes have 3 steps instead of 400.
"""

import sys
import tempfile
import types
from pathlib import Path

from images import compare, end, require_opengl

require_opengl()

import matplotlib

matplotlib.use("Agg")
import h5py
import numpy as np

from mjsense.compat import dm_control

# Its module of helpers also has the training's data set, which the recorder does not use.
for name in ("torch", "torch.utils", "torch.utils.data"):
    sys.modules.setdefault(name, types.ModuleType(name))
sys.modules["torch"].utils = sys.modules["torch.utils"]
sys.modules["torch.utils"].data = data = sys.modules["torch.utils.data"]
data.Dataset = data.DataLoader = data.TensorDataset = object

sys.path.insert(0, sys.argv[1])
import record_sim_episodes

TASKS = ("sim_transfer_cube_scripted", "sim_insertion_scripted")


def record(folder):
    files = {}
    for task in TASKS:
        np.random.seed(0)
        record_sim_episodes.SIM_TASK_CONFIGS[task]["episode_len"] = 3
        out = Path(folder, task)
        record_sim_episodes.main({"task_name": task, "dataset_dir": str(out), "num_episodes": 1, "onscreen_render": False})
        with h5py.File(out / "episode_0.hdf5") as file:
            files[task] = {name: file[name][:] for name in ("observations/images/top", "observations/qpos", "action")}
    return files


with tempfile.TemporaryDirectory() as folder:
    theirs = record(Path(folder, "theirs"))
    dm_control.use()
    ours = record(Path(folder, "ours"))
for task in TASKS:
    for name in ("observations/qpos", "action"):
        np.testing.assert_array_equal(ours[task][name], theirs[task][name])
    images = ours[task]["observations/images/top"], theirs[task]["observations/images/top"]
    for step in range(len(images[0])):
        compare(f"{task} step {step}", images[1][step], images[0][step], 24)
end()
