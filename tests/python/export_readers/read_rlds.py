# SPDX-License-Identifier: Apache-2.0
"""Reads a data set with tensorflow-datasets and compares it with what was exported. Run by test_export_formats.py.

    python read_rlds.py FOLDER EXPECTED.npz
"""

import os
import sys
from pathlib import Path

os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
import numpy as np
import tensorflow_datasets as tfds

folder, expected = Path(sys.argv[1]).resolve(), np.load(sys.argv[2])
builder = tfds.builder(folder.name, data_dir=folder.parent)
count = 0
for i, episode in enumerate(tfds.as_numpy(builder.as_dataset(split="train"))):
    assert episode["episode_metadata"]["outcome"].decode() == str(expected[f"{i}/outcome"])
    steps = list(episode["steps"])
    for name in ("action", "reward", "is_first", "is_last", "language_instruction"):
        np.testing.assert_array_equal([step[name] for step in steps], expected[f"{i}/{name}"], err_msg=name)
    for name in steps[0]["observation"]:
        np.testing.assert_array_equal([step["observation"][name] for step in steps], expected[f"{i}/observation/{name}"], err_msg=name)
    count += 1
assert count == int(expected["episodes"]) and builder.info.splits["train"].num_examples == count
print("read", count)
