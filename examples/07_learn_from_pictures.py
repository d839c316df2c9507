# SPDX-License-Identifier: Apache-2.0
"""Record picks, train a network on two cameras, and count how often it picks in episodes that it has not seen.

The network receives the images of the outer camera of `close_up` and of the wrist camera (128x96), the pose of the tool, the opening of
the gripper, and the words of the instruction. It receives no pose of an object. It returns the poses of the tool for the next 12 steps,
which the controller `ee_delta_pose` follows. An auxiliary loss asks in which pixels the object is; recordings contain them.

    pip install "mjsense[torch,dataset]"
    python examples/07_learn_from_pictures.py [--episodes 200] [--steps 6000] [--judged 200]
"""

import argparse
import tempfile
import time
from collections import deque
from contextlib import closing
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]
from torch.nn import functional as F  # pyright: ignore[reportMissingImports]

import mjsense as mjs

CAMERAS = ("exo_camera_1", "wrist_camera")
WIDTH, HEIGHT, CELL = 128, 96, 4  # pixels; the network finds the object on a grid of cells
CHUNK = 12  # steps that the network predicts
STEPS = 120  # of an episode that is judged; the planner needs 60 to 110
HELD = 5  # steps; an object that is knocked over may be off the table for a moment
OPENING, CLOSED = 0.8, 255.0  # rad of the closed fingers, command that closes them
LIMITS = np.array([0.15] * 3 + [1.0] * 3)  # of a move: m, rad
CONTROLLER = "{ kind = 'ee_delta_pose', reference = 'measured', max_translation = 0.15, max_rotation = 1.0 }"


# -------------------------------------------------------------------------------------------------------------- poses [..., 7], m and wxyz


def multiply(a, b):
    """Product of quaternions."""
    aw, av, bw, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([aw * bw - (av * bv).sum(-1, keepdims=True), aw * bv + bw * av + np.cross(av, bv)], -1)


def quaternion(vector):
    """Quaternion of a rotation vector in rad."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * vector / np.maximum(angle, 1e-9)], -1)


def difference(start, end):
    """Translation and rotation vector from one pose to another, in the axes of their frame: ``[..., 6]``."""
    turn = multiply(end[..., 3:], start[..., 3:] * [1, -1, -1, -1])
    turn = np.where(turn[..., :1] < 0, -turn, turn)
    length = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    vector = turn[..., 1:] / np.maximum(length, 1e-9) * 2 * np.arctan2(length, turn[..., :1])
    return np.concatenate([end[..., :3] - start[..., :3], vector], -1)


def state(tool, fingers):
    """Position of the tool, two axes of its rotation matrix, and how far the gripper is closed: float32 ``[N, 10]``."""
    w, x, y, z = np.moveaxis(tool[:, 3:], -1, 0)
    axes = [
        1 - 2 * (y * y + z * z),
        2 * (x * y + w * z),
        2 * (x * z - w * y),
        2 * (x * y - w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z + w * x),
    ]
    return np.concatenate([tool[:, :3], np.stack(axes, -1), fingers[:, None] / OPENING], 1).astype(np.float32)


# ------------------------------------------------------------------------------------------------------------------------- demonstrations


class Demonstrations:
    """All observations of a recording, with the actions that followed.

    ``images[camera]`` uint8 ``[N, H, W, 3]``, ``state`` ``[N, 10]``, ``words`` ``[N, V]``, ``cells[camera]`` int64 ``[N]``: the cell
    that shows the object, or the number of cells if none does; ``chunks`` ``[N, CHUNK, 7]``: moves of the tool and whether to close.
    """

    def __init__(self, path, episodes=None):
        chosen = mjs.Dataset(path).episodes[:episodes]
        self.vocabulary = sorted({word for episode in chosen for word in sentence(episode).split()})
        self.images = {
            camera: np.concatenate([episode.video(camera)[: episode.length - 1] for episode in chosen]) for camera in CAMERAS
        }
        cells, states, words, chunks = {camera: [] for camera in CAMERAS}, [], [], []
        for episode in chosen:
            steps = episode.length - 1
            tool = episode["obs/extra/tcp_pose"].astype(float)
            # Row t of the actions led to observation t; a chunk repeats the last one.
            rows = np.minimum(np.arange(steps)[:, None] + np.arange(1, CHUNK + 1), steps)
            moves = difference(tool[:steps, None], episode["actions/ee_pose/arm"][rows])
            close = episode["actions/joint_pos/gripper"][rows] > CLOSED / 2
            chunks.append(np.concatenate([moves, close], -1))
            states.append(state(tool, episode["obs/agent/qpos"]["gripper"][:, 0])[:steps])
            words.append(np.tile(bag(sentence(episode), self.vocabulary), (steps, 1)))
            for camera in CAMERAS:
                points = episode[f"obs/extra/object_image_points/pickup_obj/{camera}/points"][:steps]
                seen = np.isfinite(points[..., 0])
                middle = np.where(seen[..., None], points, 0).sum(1) / np.maximum(seen.sum(1), 1)[:, None]
                column, row = (
                    np.minimum(middle * [WIDTH // CELL, HEIGHT // CELL], [WIDTH // CELL - 1, HEIGHT // CELL - 1]).astype(int).T
                )
                cells[camera].append(np.where(seen.any(1), row * (WIDTH // CELL) + column, WIDTH * HEIGHT // CELL**2))
        self.cells = {camera: torch.as_tensor(np.concatenate(cells[camera])) for camera in CAMERAS}
        self.state, self.words, self.chunks = (
            torch.as_tensor(np.concatenate(rows), dtype=torch.float32) for rows in (states, words, chunks)
        )


def sentence(episode):
    return episode.obs_scene["task_description"].lower()


def bag(text, vocabulary):
    """Which words of the vocabulary a sentence has: ``[V]``."""
    return np.isin(vocabulary, text.lower().split()).astype(np.float32)


# -------------------------------------------------------------------------------------------------------------------------------- network


class Encoder(nn.Module):
    """Finds the object of the instruction in the images of one camera, and describes the images by points and features."""

    def __init__(self, words, channels=32, points=12):
        super().__init__()
        self.first = nn.Conv2d(3, 16, 5, 2, 2)
        self.second = nn.Conv2d(16, channels, 3, 2, 1)
        self.more = nn.ModuleList(nn.Conv2d(channels, channels, 3, padding=gap, dilation=gap) for gap in (1, 3))
        self.norms = nn.ModuleList(nn.GroupNorm(4, channels) for _ in range(3))
        self.film = nn.Linear(words, 3 * 2 * channels)
        self.maps = nn.Conv2d(channels, points, 1)
        self.nowhere = nn.Parameter(torch.zeros(1))
        row, column = torch.meshgrid(torch.linspace(-1, 1, HEIGHT // CELL), torch.linspace(-1, 1, WIDTH // CELL), indexing="ij")
        self.register_buffer("grid", torch.stack([column, row], -1).reshape(-1, 2))
        self.size = 2 * points + channels + 1

    def forward(self, image, words):
        """Features ``[B, size]`` and log-probabilities of the object's cell ``[B, cells + 1]``; the last means that it is not visible."""
        film = self.film(words).reshape(len(words), 3, 2, -1, 1, 1)
        x = self.norms[0](self.second(F.relu(self.first(image))))
        x = F.relu(x * (1 + film[:, 0, 0]) + film[:, 0, 1])
        for n, (conv, norm) in enumerate(zip(self.more, self.norms[1:], strict=True), 1):
            x = x + F.relu(norm(conv(x)) * (1 + film[:, n, 0]) + film[:, n, 1])
        maps = self.maps(x).flatten(2)
        shares = maps.softmax(-1)
        where = torch.cat([maps[:, 0], self.nowhere.expand(len(x), 1)], 1).log_softmax(1)
        there = torch.einsum("bn,bcn->bc", shares[:, 0], x.flatten(2))
        return torch.cat([(shares @ self.grid).flatten(1), there, where[:, -1:].exp()], 1), where


class Network(nn.Module):
    """The next moves of the tool and whether to close the gripper, from images, state and words."""

    def __init__(self, vocabulary, mean, scale, width=384):
        super().__init__()
        self.vocabulary = vocabulary
        self.encoders = nn.ModuleDict({camera: Encoder(len(vocabulary)) for camera in CAMERAS})
        inputs = sum(encoder.size for encoder in self.encoders.values()) + len(mean["state"]) + len(vocabulary)
        self.body = nn.Sequential(nn.Linear(inputs, width), nn.GELU(), nn.Linear(width, width), nn.GELU(), nn.Dropout(0.1),
                                  nn.Linear(width, CHUNK * 7))  # fmt: skip
        for name in mean:
            self.register_buffer(f"{name}_mean", mean[name])
            self.register_buffer(f"{name}_scale", scale[name])

    def forward(self, images, state, words):
        """Chunk ``[B, CHUNK, 7]`` (normalised moves, logit of closing) and the log-probabilities of the object's cell by camera."""
        features, where = [(state - self.state_mean) / self.state_scale, words], {}
        for camera, encoder in self.encoders.items():
            image = images[camera].permute(0, 3, 1, 2).float() / 128 - 1
            found, where[camera] = encoder(image, words)
            features.append(found)
        return self.body(torch.cat(features, 1)).reshape(-1, CHUNK, 7), where


def new_network(data, seed=0):
    torch.manual_seed(seed)
    mean = {"state": data.state.mean(0), "move": data.chunks[..., :6].mean(0)}
    scale = {"state": data.state.std(0) + 1e-2, "move": data.chunks[..., :6].std(0) + 1e-3}
    return Network(data.vocabulary, mean, scale)


def train(network, data, steps, batch=64):
    """Trains with a learning rate that falls to zero."""
    optimizer = torch.optim.AdamW(network.parameters(), lr=0, weight_decay=1e-2)
    begun = time.process_time()
    network.train()
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = 1e-3 * min(1, (step + 1) / 200) * (1 - step / steps)
        chosen = torch.randint(len(data.state), (batch,))
        images = {camera: torch.as_tensor(rows[chosen.numpy()]) for camera, rows in data.images.items()}
        noisy = data.state[chosen] + 0.03 * network.state_scale * torch.randn(batch, data.state.shape[1])
        out, where = network(images, noisy, data.words[chosen])
        target = data.chunks[chosen]
        moves = F.l1_loss(out[..., :6], (target[..., :6] - network.move_mean) / network.move_scale)
        close = F.binary_cross_entropy_with_logits(out[..., 6], target[..., 6])
        found = sum(F.nll_loss(where[camera], data.cells[camera][chosen]) for camera in CAMERAS)
        optimizer.zero_grad()
        (moves + 0.3 * close + 0.1 * found).backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        if step % (steps // 20 + 1) == 0:
            losses = f"moves {moves:.3f}, close {close:.3f}, object {found / 2:.2f}"
            print(f"  step {step}, {time.process_time() - begun:.0f} s of CPU time: {losses}", flush=True)
    return network.eval()


# ----------------------------------------------------------------------------------------------------------------------------- evaluation


class Follower:
    """Runs a network in many worlds. Each step it follows the mean of the last predictions for this step."""

    def __init__(self, network, instructions):
        self.network = network
        self.words = torch.as_tensor(np.stack([bag(text, network.vocabulary) for text in instructions]))
        self.plans = deque(maxlen=4)

    def __call__(self, obs):
        images = {camera: torch.as_tensor(obs[camera]) for camera in CAMERAS}
        tool = obs["tcp_pose"].astype(float)
        with torch.no_grad():
            out, _ = self.network(images, torch.as_tensor(state(tool, obs["qpos"]["gripper"][:, 0])), self.words)
            moves = (out[..., :6] * self.network.move_scale + self.network.move_mean).numpy()
            close = out[..., 6].sigmoid().numpy()
        targets = np.concatenate(
            [tool[:, None, :3] + moves[..., :3], multiply(quaternion(moves[..., 3:]), tool[:, None, 3:])], -1
        )
        self.plans.appendleft((targets, close))
        now = [difference(tool, targets[:, age]) for age, (targets, _) in enumerate(self.plans)]
        shut = np.mean([close[:, age] for age, (_, close) in enumerate(self.plans)], 0) > 0.5
        return np.concatenate([np.clip(np.mean(now, 0), -LIMITS, LIMITS), np.where(shut, CLOSED, 0)[:, None]], 1).astype(
            np.float32
        )


def success_rate(network, episodes, scene="", seed=10_000, worlds=50):
    """Share of unseen episodes in which the robot held the object above the table for HELD steps without a break."""
    won = []
    with closing(mjs.make_vec("pick", "franka", scene=scene, num_envs=min(worlds, episodes), arm_controller=CONTROLLER, horizon=STEPS + 1, width=WIDTH,
                              height=HEIGHT, camera_system="close_up", instructions="canonical", action_noise=False,
                              observations=[*CAMERAS, "qpos", "tcp_pose"])) as env:  # fmt: skip
        while len(won) < episodes:
            obs, _ = env.reset(seed=seed + len(won))
            follow, held = Follower(network, env.instructions), np.zeros(env.num_envs, int)
            lifted = np.zeros(env.num_envs, bool)
            for _ in range(STEPS):
                obs, _, _, _, info = env.step(follow(obs))
                held = np.where(info["success"], held + 1, 0)
                lifted |= held >= HELD
            won.extend(lifted)
    return np.mean(won)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--episodes", type=int, default=200, help="Number of demonstrations.")
    arguments.add_argument("--steps", type=int, default=6000, help="Number of training steps.")
    arguments.add_argument("--judged", type=int, default=200, help="Number of unseen episodes.")
    arguments.add_argument("--data", type=Path, help="Recording to read instead of a new one.")
    arguments.add_argument("--network", type=Path, help="File to which the trained network is written.")
    chosen = arguments.parse_args()
    torch.set_num_threads(1)  # the networks are small
    with tempfile.TemporaryDirectory() as out:
        path = chosen.data
        if path is None:
            made = mjs.record("pick", "franka", policy="top_down_planner", camera_system="close_up", width=WIDTH, height=HEIGHT, crf=12,
                              out=out, episodes=chosen.episodes, worlds=8, replay=False)  # fmt: skip
            path = made.path
        data = Demonstrations(path, chosen.episodes)
    print(f"{chosen.episodes} demonstrations, {len(data.state)} steps", flush=True)
    network = new_network(data)
    print(f"untrained: {success_rate(network.eval(), min(50, chosen.judged)):.0%}", flush=True)
    train(network, data, chosen.steps)
    if chosen.network:
        torch.save(network, chosen.network)
    print(f"trained: {success_rate(network, chosen.judged):.1%} of {chosen.judged} unseen episodes", flush=True)


if __name__ == "__main__":
    main()
