# SPDX-License-Identifier: Apache-2.0
"""Elapsed time of a recording on a local Ray cluster with different numbers of workers, without the start of Ray.

    ./dev python bench/cluster.py [1 2]         (needs ray, fsspec and pyarrow)
"""

import sys
import tempfile

import ray
from mjsense.cluster import Job, record_on_ray

ARGUMENTS = {"task": "pick", "horizon": 80, "keep_failures": True, "width": 320, "height": 184, "worlds": 2, "seed": 2}

if __name__ == "__main__":
    for workers in [int(word) for word in sys.argv[1:]] or [1, 2]:
        ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
        with tempfile.TemporaryDirectory() as out:
            summary = record_on_ray(Job(out, ARGUMENTS), episodes=32, max_attempts=32, shard_attempts=4)
        print(f"{workers} workers: {summary.seconds:.1f} s, {summary.kept} episodes")
        ray.shutdown()
