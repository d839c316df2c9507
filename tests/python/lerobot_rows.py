# SPDX-License-Identifier: Apache-2.0
"""Reads every frame of a data set with LeRobot and compares it with what was exported. Run by test_lerobot.py in LeRobot's environment.

    python lerobot_rows.py DATA_SET EXPECTED.npz
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np

warnings.simplefilter("ignore")
import lerobot

try:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError:
    from lerobot.datasets import LeRobotDataset

root, expected = Path(sys.argv[1]), np.load(sys.argv[2])
dataset = LeRobotDataset("local/data", root=root)
wrong = 0
tasks = json.loads(str(expected["tasks"]))
assert len(dataset) == len(tasks), (len(dataset), len(tasks))
for i in range(len(dataset)):
    item = dataset[i]
    ok = item["task"] == tasks[i]
    for name in expected.files:
        if name == "tasks":
            continue
        value = item[name].numpy()
        if name.startswith("observation.images."):
            found = np.rint(value * 255).astype(np.uint8).transpose(1, 2, 0)
            # Converters from YUV to RGB differ by a few levels; neighbouring frames differ by more.
            ok = ok and found.shape == expected[name][i].shape and np.abs(found.astype(int) - expected[name][i]).mean() < 1.5
        else:
            ok = ok and np.array_equal(value, expected[name][i])
    wrong += not ok
print(f"{len(dataset)} frames, {wrong} wrong, codebase {dataset.meta.info['codebase_version'] if isinstance(dataset.meta.info, dict) else 'v3.0'}")
sys.exit(wrong > 0)
