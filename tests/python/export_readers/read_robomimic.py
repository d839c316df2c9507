# SPDX-License-Identifier: Apache-2.0
"""Reads a file with robomimic's SequenceDataset and compares all items with the file. Run by test_export_formats.py.

    python read_robomimic.py FILE
"""

import sys

import h5py
import numpy as np
import robomimic.utils.obs_utils as obs_utils
from robomimic.utils.dataset import SequenceDataset


def as_read(values):
    """robomimic's cache has 32-bit floats."""
    return values.astype(np.float32) if values.dtype == np.float64 else values


path = sys.argv[1]
with h5py.File(path) as file:
    demos = {name: {key: as_read(data[:]) for key, data in file[f"data/{name}/obs"].items()} for name in file["data"]}
    actions = {name: as_read(file[f"data/{name}/actions"][:]) for name in file["data"]}
    valid = [name.decode() for name in file["mask/valid"]]
keys = list(demos["demo_0"])
images = {"rgb": [k for k in keys if k.endswith("_image")], "depth": [k for k in keys if k.endswith("_depth")]}
obs_utils.initialize_obs_utils_with_obs_specs({"obs": {"low_dim": ["state"], **images}})
for cache in ("all", "low_dim", None):
    for only in (None, "valid"):
        dataset = SequenceDataset(path, keys, ("actions", "rewards", "dones"), seq_length=4, load_next_obs=True, hdf5_cache_mode=cache,
                                  filter_by_attribute=only)  # fmt: skip
        chosen = valid if only else sorted(demos)
        places = [(demo, t) for demo in chosen for t in range(len(actions[demo]))]
        assert len(dataset) == len(places)
        for i, (demo, t) in enumerate(places):
            item, end = dataset[i], len(actions[demo]) - 1
            for k in range(4):
                assert np.array_equal(as_read(item["actions"][k]), actions[demo][min(t + k, end)])
                for key in keys:
                    now = item["obs"][key][k]
                    assert now.shape == demos[demo][key].shape[1:] and np.array_equal(as_read(now), demos[demo][key][min(t + k, end)]), (demo, t, key)
                    if t + k < end:
                        assert np.array_equal(as_read(item["next_obs"][key][k]), demos[demo][key][t + k + 1])
print("read", len(places))
