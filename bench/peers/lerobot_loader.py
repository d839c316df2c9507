# SPDX-License-Identifier: Apache-2.0
"""Samples per second of LeRobot's loader, run by bench/export.py in LeRobot's environment.

python lerobot_loader.py DATA_SET sequential|random SECONDS
"""

import sys
import time

import numpy as np
import torch

try:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError:
    from lerobot.datasets import LeRobotDataset

folder, order, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
torch.set_num_threads(1)
dataset = LeRobotDataset("local/data", root=folder)
dataset[0]  # opens the files
indices = np.arange(len(dataset)) if order == "sequential" else np.random.default_rng(0).permutation(len(dataset))
begun, cpu = time.perf_counter(), time.process_time()
for n, i in enumerate(indices, 1):
    dataset[int(i)]
    if time.perf_counter() - begun > seconds:
        break
print(n / (time.perf_counter() - begun), n / (time.process_time() - cpu))
