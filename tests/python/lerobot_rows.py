# SPDX-License-Identifier: Apache-2.0
"""Reads a data set with LeRobot and compares every row and frame with what was exported. Run by test_lerobot.py in LeRobot's environment.

    python lerobot_rows.py DATA_SET EXPECTED.npz STEP TOLERANCE [stream | delete]

With ``stream``, the rows are read by StreamingLeRobotDataset; with ``delete``, after LeRobot has deleted the first episode.
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
mode = "".join(sys.argv[5:])
dataset = LeRobotDataset("local/data", root=root)
first = 0
if mode == "delete":
    from lerobot.datasets.dataset_tools import delete_episodes

    first = dataset.meta.episodes[0]["length"]
    dataset = delete_episodes(dataset, [0], output_dir=root.with_name("deleted"), repo_id="local/deleted")
read = [i for i in range(len(dataset)) if i % step == 0 or i >= len(dataset) - 1000]
items = (dataset[i] for i in read)
if mode == "stream":
    from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset

    items = iter(StreamingLeRobotDataset("local/data", root=root, shuffle=False, buffer_size=2, max_num_shards=1))
wrong = 0
for item in items:
    at = (int(item["index"]) + first) % len(tasks)
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
