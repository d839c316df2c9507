# SPDX-License-Identifier: Apache-2.0
"""Reads a data set with LeRobot and compares every row and frame with what was exported. Run by test_lerobot.py in LeRobot's environment.

    python lerobot_rows.py DATA_SET EXPECTED.npz STEP TOLERANCE

The mean difference of an image may be TOLERANCE levels. The episodes of EXPECTED.npz repeat in the data set. Of all rows but the last 1000, every STEP-th is read.
"""

import json
import sys
from pathlib import Path

import numpy as np

try:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError:
    from lerobot.datasets import LeRobotDataset

root, expected, step = Path(sys.argv[1]), dict(np.load(sys.argv[2])), int(sys.argv[3])
tolerance = float(sys.argv[4])
tasks = json.loads(str(expected.pop("tasks")))
dataset = LeRobotDataset("local/data", root=root)
read = [i for i in range(len(dataset)) if i % step == 0 or i >= len(dataset) - 1000]
wrong = 0
for i in read:
    item, at = dataset[i], i % len(tasks)
    right = item["task"] == tasks[at]
    for name, values in expected.items():
        value = item[name].numpy()
        if name.startswith("observation.images.") and values.ndim == 3:  # depth: mm, to be compared with m
            right = right and (np.abs(value[0] / 1000 - values[at].clip(0.01, 10)) < 0.003).all()
            continue
        if name.startswith("observation.images."):
            value = np.rint(value * 255).astype(np.uint8).transpose(1, 2, 0)
        same = np.abs(np.subtract(value, values[at], dtype=float)).mean() <= (tolerance if value.ndim == 3 else 0)
        right = right and value.shape == values[at].shape and same
    wrong += not right
print(json.dumps({"rows": len(dataset), "read": len(read), "wrong": wrong, "stats": sorted(dataset.meta.stats["action"])}))
