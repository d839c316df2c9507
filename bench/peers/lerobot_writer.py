# SPDX-License-Identifier: Apache-2.0
"""CPU time of LeRobot's writer, run by bench/export.py in LeRobot's environment (0.4).

    python lerobot_writer.py DATA_SET OUT png|av1|h264 STEPS

The frames of a data set are written again, at a whole number of frames per second, because 0.4.4 cannot write others. png: PNG
files, then AV1, LeRobot's default; av1, h264: encoded while recording.
"""

import resource
import sys

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

source, out, mode, steps = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
dataset = LeRobotDataset("local/data", root=source)
frames = []
for i in range(min(steps, len(dataset))):
    item = dataset[i]
    images = {key: np.rint(item[key].numpy() * 255).astype(np.uint8).transpose(1, 2, 0) for key in dataset.meta.camera_keys}
    frames.append(
        {"observation.state": item["observation.state"].numpy(), "action": item["action"].numpy(), "task": item["task"], **images}
    )
names = ["observation.state", "action", *dataset.meta.camera_keys]
features = {name: {key: dataset.features[name][key] for key in ("dtype", "shape", "names")} for name in names}


def cpu() -> float:
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


begun = cpu()
writer = LeRobotDataset.create(
    "local/out",
    round(dataset.fps),
    features,
    root=out,
    image_writer_threads=0 if mode != "png" else 4,
    streaming_encoding=mode != "png",
    vcodec="h264" if mode == "h264" else "libsvtav1",
)
for frame in frames:
    writer.add_frame(frame)
writer.save_episode()
writer.finalize()
print(len(frames) / (cpu() - begun))
