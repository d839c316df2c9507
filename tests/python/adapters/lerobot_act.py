# SPDX-License-Identifier: Apache-2.0
"""A small checkpoint that LeRobot trains on a data set, run with LeRobot's Python.

python lerobot_act.py DATA_SET OUT KIND STEPS
"""

import sys
from pathlib import Path

import torch

try:
    from lerobot.configs.types import FeatureType
    from lerobot.datasets.lerobot_dataset import LeRobotDataset, LeRobotDatasetMetadata
    from lerobot.datasets.utils import dataset_to_policy_features
except ImportError:
    from lerobot.configs import FeatureType
    from lerobot.datasets import LeRobotDataset, LeRobotDatasetMetadata
    from lerobot.utils.feature_utils import dataset_to_policy_features
from lerobot.policies.factory import get_policy_class, make_policy_config, make_pre_post_processors

root, out, kind, steps = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], int(sys.argv[4])
SMALL = {
    "act": {"chunk_size": 12, "n_action_steps": 8, "dim_model": 64, "n_heads": 2, "dim_feedforward": 128, "n_encoder_layers": 1,
            "n_vae_encoder_layers": 1, "pretrained_backbone_weights": None},
    "diffusion": {"noise_scheduler_type": "DDIM", "horizon": 8, "n_action_steps": 4, "down_dims": (16, 32), "num_train_timesteps": 4, "num_inference_steps": 2,
                  "crop_shape": None, "pretrained_backbone_weights": None, "spatial_softmax_num_keypoints": 4},
}  # fmt: skip
torch.manual_seed(0)
meta = LeRobotDatasetMetadata("local/data", root=root)
features = dataset_to_policy_features(meta.features)
actions = {name: one for name, one in features.items() if one.type is FeatureType.ACTION}
inputs = {name: one for name, one in features.items() if name not in actions}
config = make_policy_config(kind, input_features=inputs, output_features=actions, device="cpu", push_to_hub=False, **SMALL[kind])
policy = get_policy_class(kind)(config)
before, after = make_pre_post_processors(config, dataset_stats=meta.stats)
times = {name: [i / meta.fps for i in config.observation_delta_indices or [0]] for name in inputs}
times = times if config.observation_delta_indices else {}
times["action"] = [i / meta.fps for i in config.action_delta_indices]
dataset = LeRobotDataset("local/data", root=root, delta_timestamps=times)
loader = torch.utils.data.DataLoader(dataset, batch_size=8, shuffle=True, drop_last=True)
optimizer = torch.optim.Adam(policy.parameters(), 1e-3)
policy.train()
done = 0
while done < steps:
    for batch in loader:
        loss, _ = policy.forward(before(batch))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        done += 1
        if done >= steps:
            break
policy.save_pretrained(out)
before.save_pretrained(out)
after.save_pretrained(out)
