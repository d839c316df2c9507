# SPDX-License-Identifier: Apache-2.0
"""Record picks, train a network to do what the planner did, and count how often it picks in episodes that it has not seen.

Minutes on two cores, without a picture: it sees the joints, and where its object is in the frame of its tool. The scene is the
plain table, and grasps come from above: what is easiest to learn.

    pip install "mjsense[torch,dataset,evaluate]"
    python examples/06_clone_the_planner.py [--out clone] [--recorded 200] [--judged 200] [--passes 120]

The folder keeps the recordings of the demonstrations and of the judged episodes, with a report of each, and the network, which
the program evaluates too:

    mjsense evaluate pick --scene table --policy examples/06_clone_the_planner.py:ClonePolicy \\
        --policy-option net=clone/network.pt --out results
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

import mjsense as mjs

OBJECTS = ("red_block", "blue_cube", "soup_can", "yellow_puck", "marker", "mug", "pear", "toy_bone")
CLOSED = 255.0  # command of the gripper
STEPS = 150  # of an episode that is judged; the planner needs 60 to 110


def matrices(quat):
    """Rotation matrices ``[N, 3, 3]`` of quaternions wxyz ``[N, 4]``."""
    w, x, y, z = np.moveaxis(quat, -1, 0)
    rows = [
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    ]
    return np.stack(rows, -1).reshape(*quat.shape[:-1], 3, 3)


def features(arm, fingers, speed, tool, actors, target):
    """What the network sees: float32 ``[N, F]``.

    arm ``[N, 7]``, fingers ``[N]`` rad, speed ``[N]`` of the fingers rad/s, tool ``[N, 7]`` in the base frame, which on this
    table is the world's, actors ``[8, N, 13]``, target ``[N]``: which of them is meant.
    """
    thing = actors[target, np.arange(len(target)), :7]
    R, turn = matrices(tool[:, 3:]), matrices(thing[:, 3:])
    there = np.einsum("nji,nj->ni", R, thing[:, :3] - tool[:, :3])
    turned = np.einsum("nji,njk->nik", R, turn)[:, :, :2].reshape(-1, 6)
    kind = np.eye(len(OBJECTS))[target]
    return np.concatenate([arm, tool[:, :3], 5 * there, turned, fingers[:, None], speed[:, None], kind], 1).astype(np.float32)


def target_of(actors, start):
    """Which object stands where the episode's does: int ``[N]``."""
    return np.linalg.norm(actors[:, :, :3] - start[None, :, :3], axis=-1).argmin(0)


def demonstrations(path):
    """(what was seen ``[N, F]``, joints' moves ``[N, 7]`` rad, whether the hand closes ``[N]``) of all steps of all episodes."""
    seen, moved, closed = [], [], []
    for episode in mjs.Dataset(path).episodes:
        actors = np.stack([episode[f"env_states/actors/{name}"] for name in OBJECTS])
        start = episode["obs/extra/obj_start"]
        target = np.full(len(start), target_of(actors[:, :1], start[:1])[0])
        qpos, qvel = episode["obs/agent/qpos"], episode["obs/agent/qvel"]
        x = features(qpos["arm"], qpos["gripper"][:, 0], qvel["gripper"][:, 0], episode["obs/extra/tcp_pose"], actors, target)
        # Row t of the actions led to observation t.
        seen.append(x[:-2])
        moved.append(episode["actions/joint_pos_rel/arm"][1:-1].astype(np.float32))
        closed.append(episode["actions/joint_pos/gripper"][1:-1, 0] > CLOSED / 2)
    return np.concatenate(seen), np.concatenate(moved), np.concatenate(closed)


class Clone(torch.nn.Module):
    """Joints' moves and whether to close, of what is seen."""

    def __init__(self, x, moves):
        super().__init__()
        width = 256
        self.net = torch.nn.Sequential(
            torch.nn.Linear(x.shape[1], width),
            torch.nn.GELU(),
            torch.nn.Linear(width, width),
            torch.nn.GELU(),
            torch.nn.Linear(width, width),
            torch.nn.GELU(),
            torch.nn.Linear(width, 8),
        )
        for name, value in {"mean": x.mean(0), "scale": x.std(0) + 1e-3, "move": moves.std(0)}.items():
            self.register_buffer(name, value)

    def forward(self, x):
        return self.net((x - self.mean) / self.scale)


def train(x, moves, closed, passes, seed=0):
    torch.manual_seed(seed)
    x, moves, closed = (torch.as_tensor(v) for v in (x, moves, closed.astype(np.float32)))
    net = Clone(x, moves)
    batch, steps = 512, passes * (len(x) // 512 + 1)
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 2e-3, total_steps=steps)
    for step in range(steps):
        pick = torch.randint(len(x), (batch,))
        out = net(x[pick])
        loss = torch.nn.functional.smooth_l1_loss(out[:, :7], moves[pick] / net.move)
        loss = loss + 0.2 * torch.nn.functional.binary_cross_entropy_with_logits(out[:, 7], closed[pick])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % (steps // 5 + 1) == 0:
            print(f"  step {step}: loss {loss.item():.4f}", flush=True)
    return net.eval()


class ClonePolicy(mjs.Policy):
    """The network as a policy of mjsense's: one call for all worlds.

    net: a network, or the path of one.
    """

    observation = ("qpos", "qvel", "tcp_pose", "obj_start", "env_states")

    def __init__(self, net):
        self.net = net if isinstance(net, Clone) else loaded(net)

    def initialize(self):
        self.target = np.full(self.num_worlds, -1)

    def reset(self, ids):
        self.target[ids] = -1

    def act(self, obs):
        actors = np.stack([obs["env_states"]["actors"][name] for name in OBJECTS])
        new = self.target < 0
        self.target[new] = target_of(actors, obs["obj_start"])[new]
        arm = obs["qpos"]["arm"]
        x = features(arm, obs["qpos"]["gripper"][:, 0], obs["qvel"]["gripper"][:, 0], obs["tcp_pose"], actors, self.target)
        with torch.no_grad():
            out = self.net(torch.as_tensor(x))
            moves = (out[:, :7] * self.net.move).numpy()
        return {"arm": arm + moves, "gripper": np.where(out[:, 7:].numpy() > 0, CLOSED, 0.0)}


def loaded(path):
    """The network of a file."""
    weights = torch.load(path, weights_only=True)
    net = Clone(torch.zeros(2, len(weights["mean"])), torch.zeros(2, 7))
    net.load_state_dict(weights)
    return net.eval()


def evaluated(policy, episodes, out):
    """Results of unseen episodes: success means that the object was lifted at the last step or before."""
    return mjs.evaluate(
        "pick",
        scene="table",
        policy=policy,
        out=out,
        overwrite=True,
        episodes=episodes,
        num_worlds=50,
        seed=10_000,
        horizon=STEPS,
        cameras=[],
    )


def main(out, recorded=200, judged=200, passes=120):
    begun = time.perf_counter()
    made = mjs.record(
        "pick",
        scene="table",
        policy="top_down_planner",
        out=out / "demonstrations",
        overwrite=True,
        episodes=recorded,
        num_worlds=16,
        cameras=[],
    )
    print(f"{made.kept} picks recorded in {time.perf_counter() - begun:.0f} s", flush=True)
    x, moves, closed = demonstrations(made.path)
    begun = time.perf_counter()
    net = train(x, moves, closed, passes)
    torch.save(net.state_dict(), out / "network.pt")
    print(f"trained on {len(x)} steps in {time.perf_counter() - begun:.0f} s", flush=True)
    for name, network in {"untrained": Clone(torch.as_tensor(x), torch.as_tensor(moves)), "trained": net}.items():
        found = evaluated(ClonePolicy(network), judged, out / name).success
        low, high = found.interval
        print(f"{name}: {found.successes} of {judged} unseen episodes ({low:.0%} to {high:.0%})", flush=True)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--out", type=Path, default=Path("clone"), help="Folder of the recordings and the network.")
    arguments.add_argument("--recorded", type=int, default=200, help="Number of demonstrations.")
    arguments.add_argument("--judged", type=int, default=200, help="Number of unseen episodes.")
    arguments.add_argument("--passes", type=int, default=120, help="Passes over the data in training.")
    main(**vars(arguments.parse_args()))
