# SPDX-License-Identifier: Apache-2.0
"""Record picks, train a network on two cameras, and count how often it picks in episodes that it has not seen.

The network receives the images of the outer camera of `close_up` and of the wrist camera (128x96), the pose of the tool, the
opening of the gripper, and the words of the instruction. It receives no pose of an object. It returns a chunk: the poses of the
tool in the next 12 steps, relative to the present one, and whether the gripper closes. Two auxiliary losses use what recordings
contain: where in the images the objects are, and at which pose of the tool the demonstration closed the gripper.

    pip install "mjsense[torch,dataset,evaluate]"
    python examples/07_learn_from_pictures.py [--episodes 200] [--steps 3500] [--judged 200]

The program evaluates the network too:

    mjsense evaluate pick --policy examples/07_learn_from_pictures.py:Follower --policy-option network=pictures/network.pt \\
        --out results --robot franka --size 128x96 --camera-system close_up --arm-controller \\
        "{ kind = 'ee_delta_pose', frame = 'tool', reference = 'measured', max_translation = 0.15, max_rotation = 1.0 }"
"""

import argparse
import tempfile
import time
from collections import deque
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]
from torch.nn import functional as F  # pyright: ignore[reportMissingImports]

import mjsense as mjs
from mjsense.evaluation.intervals import wilson

CAMERAS = ("exo_camera_1", "wrist_camera")
MODELS = Path(__file__).resolve().parents[1] / "models/robots/franka"
WIDTH, HEIGHT = 128, 96  # pixels
CELL = {"exo_camera_1": 8, "wrist_camera": 4}  # pixels; a network works on a grid of cells
SHIFT = {"exo_camera_1": 4, "wrist_camera": 2}  # pixels; images are shifted at random in training
CHUNK = 12  # steps that the network predicts
STEPS = 120  # of an episode that is judged; the planner needs 60 to 110
HELD = 5  # steps; an object that is knocked over may be off the table for a moment
# Disturbs the state in training, so that the network does not read the goal from the path of the tool, which would confirm its
# own errors.
STATE_NOISE = torch.tensor([0.04, 0.04, 0.005] + [0.1] * 6 + [0.03])
OPENING, CLOSED = 0.8, 255.0  # rad of the closed fingers, command that closes them
LIMITS = np.array([0.15] * 3 + [1.0] * 3)  # of a move: m, rad
CONTROLLER = "{ kind = 'ee_delta_pose', frame = 'tool', reference = 'measured', max_translation = 0.15, max_rotation = 1.0 }"


# --------------------------------------------------- poses [..., 7]: m and wxyz; moves [..., 6]: m and rotation vector


def multiply(a, b):
    """Product of quaternions."""
    aw, av, bw, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([aw * bw - (av * bv).sum(-1, keepdims=True), aw * bv + bw * av + np.cross(av, bv)], -1)


def conjugate(q):
    return q * [1, -1, -1, -1]


def rotate(q, vector):
    """A vector rotated by a quaternion."""
    return vector + 2 * np.cross(q[..., 1:], np.cross(q[..., 1:], vector) + q[..., :1] * vector)


def difference(start, end):
    """Move from one pose to another, in the axes of the first: ``[..., 6]``."""
    turn = multiply(conjugate(start[..., 3:]), end[..., 3:])
    turn = np.where(turn[..., :1] < 0, -turn, turn)
    length = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    vector = turn[..., 1:] / np.maximum(length, 1e-9) * 2 * np.arctan2(length, turn[..., :1])
    return np.concatenate([rotate(conjugate(start[..., 3:]), end[..., :3] - start[..., :3]), vector], -1)


def moved(start, move):
    """The pose that a move leads to."""
    angle = np.linalg.norm(move[..., 3:], axis=-1, keepdims=True)
    turn = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * move[..., 3:] / np.maximum(angle, 1e-9)], -1)
    return np.concatenate([start[..., :3] + rotate(start[..., 3:], move[..., :3]), multiply(start[..., 3:], turn)], -1)


def state(tool, fingers):
    """Position of the tool, two axes of its rotation matrix, and how far the gripper is closed: float32 ``[N, 10]``."""
    axes = [rotate(tool[:, 3:], np.array(axis)) for axis in ([1.0, 0, 0], [0, 1.0, 0])]
    return np.concatenate([tool[:, :3], *axes, fingers[:, None] / OPENING], 1).astype(np.float32)


# ------------------------------------------------------------------------------------------------------ demonstrations


def record(out, episodes, shading):
    """Path of new demonstrations.

    The robot is `franka` with 25 times its action noise. The actions, which are recorded without noise, lead back to the path, so
    that the network learns to correct its own errors.
    """
    text = (MODELS / "robot.toml").read_text().replace('model = "', f'model = "{MODELS}/')
    robot = Path(out) / "franka_with_noise.toml"
    robot.write_text(text + "\n[noise]\nscale = 2.5\nmax_position = 0.03\n")
    return mjs.record(
        "pick",
        str(robot),
        policy="top_down_planner",
        camera_system=str(MODELS / "cameras/close_up.toml"),
        width=WIDTH,
        height=HEIGHT,
        crf=12,
        shading=shading,
        out=out,
        episodes=episodes,
        num_worlds=8,
        replay=False,
    ).path


class Demonstrations:
    """All observations of a recording, with the actions that followed.

    ``images[camera]`` uint8 ``[N, H, W, 3]``; ``points[camera]`` ``[N, K, 2]``: where the K objects are in the image, in pixels,
    NaN if they are absent; ``kinds`` ``[K, V]``: the words of their instructions; ``kind`` ``[N]``: the object of the
    instruction; ``state`` ``[N, 10]``; ``moves`` ``[N, CHUNK + 1, 6]`` to the next targets of the tool and to the one at which
    the gripper closes; ``close`` ``[N, CHUNK]``: whether the gripper closes; ``before`` ``[N]``: whether it has yet to close.
    """

    def __init__(self, path, episodes=None):
        chosen = mjs.Dataset(path).episodes[:episodes]
        self.vocabulary = sorted({word for episode in chosen for word in sentence(episode).split()})
        sentences = {target(episode): sentence(episode) for episode in chosen}
        self.kinds = torch.as_tensor(np.stack([bag(text, self.vocabulary) for text in sentences.values()]))
        self.images, self.points = {}, {}
        for camera in CAMERAS:
            self.images[camera] = np.concatenate([episode.video(camera)[: episode.length - 1] for episode in chosen])
            self.points[camera] = np.concatenate([image_points(episode, camera, sentences)[:-1] for episode in chosen])
        states, kinds, moves, closings, before = [], [], [], [], []
        for episode in chosen:
            steps = episode.length - 1
            tool = episode["obs/extra/tcp_pose"].astype(float)[:steps]
            targets, close = episode["actions/ee_pose/arm"], episode["actions/joint_pos/gripper"][:, 0] > CLOSED / 2
            closes = int(np.argmax(close))
            # Row t of the actions led to observation t. The last row has no target; a chunk repeats the one before.
            rows = np.minimum(np.arange(steps)[:, None] + np.arange(1, CHUNK + 1), steps - 1)
            grasp = np.maximum(rows[:, :1], closes)
            moves.append(difference(tool[:, None], targets[np.concatenate([rows, grasp], 1)]))
            closings.append(close[rows])
            before.append(np.arange(steps) < closes)
            states.append(state(tool, episode["obs/agent/qpos"]["gripper"][:steps, 0]))
            kinds.append(np.full(steps, list(sentences).index(target(episode))))
        self.kind = torch.as_tensor(np.concatenate(kinds))
        self.state, self.moves, self.close, self.before = (
            torch.as_tensor(np.concatenate(rows), dtype=torch.float32) for rows in (states, moves, closings, before)
        )


def image_points(episode, camera, actors):
    """Where the origins of objects are in the images of a camera, in pixels: ``[T, K, 2]``."""
    states = episode["env_states/actors"]
    absent = np.full((episode.length, 13), np.nan)
    places = np.stack([states.get(actor, absent)[:, :3] for actor in actors], 1)
    matrix, intrinsic = (episode[f"obs/sensor_param/{camera}/{name}"] for name in ("extrinsic_cv", "intrinsic_cv"))
    places = np.einsum("tij,tkj->tki", matrix[..., :3], places) + matrix[:, None, :, 3]
    places = np.einsum("tij,tkj->tki", intrinsic, places)
    return np.where(places[..., 2:] > 0, places[..., :2] / places[..., 2:], np.nan)


def target(episode):
    """Name of the object that the instruction asks for."""
    return episode.obs_scene["objects"]["pickup_obj"]["actor"]


def sentence(episode):
    return episode.obs_scene["task_description"].lower()


def bag(text, vocabulary):
    """Which words of the vocabulary a sentence has: ``[V]``."""
    return np.isin(vocabulary, text.lower().split()).astype(np.float32)


# ------------------------------------------------------------------------------------------------------------- network


class Encoder(nn.Module):
    """Finds the object of the instruction in the images of one camera, and describes the images by points and features."""

    def __init__(self, words, cell, channels=32, points=12, gaps=(1, 2, 4)):
        super().__init__()
        self.cell, self.rows, self.columns = cell, HEIGHT // cell, WIDTH // cell
        self.first = nn.Conv2d(3 * cell**2, channels, 3, padding=1)
        self.more = nn.ModuleList(nn.Conv2d(channels, channels, 3, padding=gap, dilation=gap) for gap in gaps)
        self.film = nn.Linear(words, (len(gaps) + 1) * 2 * channels)  # scale and offset of every channel, from the words
        nn.init.normal_(self.film.weight, std=0.3)
        self.maps = nn.Conv2d(channels, points, 1)
        self.nowhere = nn.Parameter(torch.zeros(1))
        row, column = torch.meshgrid(torch.linspace(-1, 1, self.rows), torch.linspace(-1, 1, self.columns), indexing="ij")
        self.register_buffer("grid", torch.stack([column, row], -1).reshape(-1, 2))
        self.size = 2 * points + channels + 1

    def forward(self, image, words):
        """Features ``[B, size]`` and log-probabilities of the object's cell ``[B, cells + 1]``; the last means that it is not
        visible."""
        n = len(image)
        x = image.reshape(n, self.rows, self.cell, self.columns, self.cell, 3)
        x = x.permute(0, 2, 4, 5, 1, 3).reshape(n, -1, self.rows, self.columns)
        with torch.autocast("cpu", torch.bfloat16):  # 1.6 times as fast as float32
            x, film = x.bfloat16() / 128 - 1, self.film(words).reshape(n, -1, 2, self.maps.in_channels, 1, 1)
            for layer, conv in enumerate([self.first, *self.more]):
                y = F.relu(F.group_norm(conv(x), 4) * (1 + film[:, layer, 0]) + film[:, layer, 1])
                x = x + y if layer else y
            maps = self.maps(x)
        maps, x = maps.flatten(2).float(), x.flatten(2).float()
        shares = maps.softmax(-1)
        where = torch.cat([maps[:, 0], self.nowhere.expand(n, 1)], 1).log_softmax(1)
        there = torch.einsum("bn,bcn->bc", shares[:, 0], x)
        return torch.cat([(shares @ self.grid).flatten(1), there, where[:, -1:].exp()], 1), where


class Network(nn.Module):
    """The next moves of the tool and whether to close the gripper, from images, state and words."""

    def __init__(self, vocabulary, mean, scale, width=384):
        super().__init__()
        self.vocabulary = vocabulary
        self.encoders = nn.ModuleDict({camera: Encoder(len(vocabulary), CELL[camera]) for camera in CAMERAS})
        inputs = sum(encoder.size for encoder in self.encoders.values()) + len(mean["state"]) + len(vocabulary)
        sizes = (inputs, width), (width, width)
        self.body = nn.Sequential(*(part for size in sizes for part in (nn.Linear(*size), nn.GELU(), nn.Dropout(0.1))))
        self.moves, self.close = nn.Linear(width, (CHUNK + 1) * 6), nn.Linear(width, CHUNK)
        for name in mean:
            self.register_buffer(f"{name}_mean", mean[name])
            self.register_buffer(f"{name}_scale", scale[name])

    def forward(self, images, state, words):
        """Normalised moves ``[B, CHUNK + 1, 6]``, logits of closing ``[B, CHUNK]``, log-probabilities of the object's cell by
        camera."""
        features, where = [(state - self.state_mean) / self.state_scale, words], {}
        for camera, encoder in self.encoders.items():
            found, where[camera] = encoder(images[camera], words)
            features.append(found)
        x = self.body(torch.cat(features, 1))
        return self.moves(x).reshape(-1, CHUNK + 1, 6), self.close(x), where


def new_network(data, seed=0):
    torch.manual_seed(seed)
    mean = {"state": data.state.mean(0), "move": data.moves.mean(0)}
    scale = {"state": data.state.std(0) + 1e-2, "move": data.moves.std(0) + 1e-3}
    return Network(data.vocabulary, mean, scale)


def augmented(images, shift):
    """Images moved by up to ``shift`` pixels and with other brightness and colour, and how far they were moved."""
    n = len(images)
    moves = torch.randint(-shift, shift + 1, (n, 2)).numpy()
    padded = np.pad(images, np.array([(0, 0), (shift, shift), (shift, shift), (0, 0)]), mode="edge")
    starts = enumerate(shift - moves)
    images = torch.as_tensor(np.stack([padded[i, y : y + HEIGHT, x : x + WIDTH] for i, (x, y) in starts]))
    gain = (1 + torch.empty(n, 1, 1, 1).uniform_(-0.3, 0.3)) * (1 + torch.empty(n, 1, 1, 3).uniform_(-0.1, 0.1))
    return (images * gain + torch.empty(n, 1, 1, 1).uniform_(-25, 25)).clamp(0, 255), moves


def cells(points, size):
    """The cells in which points are: int64 ``[B]``; the number of cells stands for a point outside the image."""
    columns, rows = WIDTH // size, HEIGHT // size
    inside = ((points >= 0) & (points < [WIDTH, HEIGHT])).all(1)  # False for NaN
    column, row = (np.where(inside[:, None], points, 0) / size).astype(int).T
    return torch.as_tensor(np.where(inside, row * columns + column, rows * columns))


def train(network, data, steps, batch=64):
    """Trains with a learning rate that falls to zero."""
    optimizer = torch.optim.AdamW(network.parameters(), lr=0, weight_decay=1e-2)
    begun = time.process_time()
    network.train()
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = 1e-3 * min(1, (step + 1) / 200) * (1 - step / steps)
        chosen = torch.randint(len(data.state), (batch,))
        rows, kind, other = chosen.numpy(), data.kind[chosen], torch.randint(len(data.kinds), (batch // 2,))
        images, places, found = {}, {}, 0.0
        for camera, encoder in network.encoders.items():
            images[camera], shift = augmented(data.images[camera][rows], SHIFT[camera])
            points = data.points[camera][rows] + shift[:, None]
            # An episode has an instruction for one object; where the others are can be learned from it too.
            _, where = encoder(images[camera][: len(other)], data.kinds[other])
            found = found + F.nll_loss(where, cells(points[range(len(other)), other], CELL[camera]))
            places[camera] = cells(points[range(batch), kind], CELL[camera])
        noisy = data.state[chosen] + STATE_NOISE * torch.randn(batch, data.state.shape[1])
        moves, close, where = network(images, noisy, data.kinds[kind])
        error = (moves - (data.moves[chosen] - network.move_mean) / network.move_scale).abs().mean(2)
        before = data.before[chosen]
        losses = {
            "moves": error[:, :CHUNK].mean(),
            "grasp": 0.5 * (error[:, CHUNK] * before).sum() / before.sum(),
            "close": 0.3 * F.binary_cross_entropy_with_logits(close, data.close[chosen]),
            "object": 0.1 * sum(F.nll_loss(where[camera], places[camera]) for camera in CAMERAS),
            "others": 0.1 * found,
        }
        optimizer.zero_grad()
        torch.stack(list(losses.values())).sum().backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        if step % (steps // 20 + 1) == 0:
            said = ", ".join(f"{name} {loss:.3f}" for name, loss in losses.items())
            print(f"  step {step}, {time.process_time() - begun:.0f} s of CPU time: {said}", flush=True)
    return network.eval()


# ---------------------------------------------------------------------------------------------------------- evaluation


class Follower:
    """A network, or that of a file, as a policy. Each step it follows the mean of the last predictions for this step."""

    observation = (*CAMERAS, "qpos", "tcp_pose")

    def __init__(self, network):
        torch.set_num_threads(1)  # the networks are small
        self.network = network if isinstance(network, Network) else loaded(network)
        self.plans = {}  # world -> its last predictions, the newest first

    def reset(self, world_ids):
        self.plans |= {world: deque(maxlen=4) for world in world_ids}

    def act(self, obs):
        images = {camera: torch.as_tensor(obs[camera]) for camera in CAMERAS}
        words = torch.as_tensor(np.stack([bag(text, self.network.vocabulary) for text in obs["instructions"]]))
        tool = obs["tcp_pose"].astype(float)
        with torch.no_grad():
            moves, close, _ = self.network(images, torch.as_tensor(state(tool, obs["qpos"]["gripper"][:, 0])), words)
        moves = (moves * self.network.move_scale + self.network.move_mean)[:, :CHUNK].numpy()
        targets, close = moved(tool[:, None], moves), close.sigmoid().numpy()
        return np.stack([self.follow(world, tool[i], targets[i], close[i]) for i, world in enumerate(obs["world_ids"])])

    def follow(self, world, tool, targets, close):
        """The mean of the predictions for now: a move of the tool, and the command of the gripper."""
        plans = self.plans[world]
        plans.appendleft((targets, close))
        move = np.mean([difference(tool, poses[age]) for age, (poses, _) in enumerate(plans)], 0)
        shut = np.mean([shares[age] for age, (_, shares) in enumerate(plans)]) > 0.5
        return np.append(np.clip(move, -LIMITS, LIMITS), CLOSED if shut else 0).astype(np.float32)


def loaded(path):
    """The network of a file."""
    content = torch.load(path, weights_only=True)
    weights, names = content["weights"], ("state", "move")
    mean, scale = ({name: weights[f"{name}_{kind}"] for name in names} for kind in ("mean", "scale"))
    network = Network(content["vocabulary"], mean, scale)
    network.load_state_dict(weights)
    return network.eval()


def evaluate(network, episodes, out, chosen, seed=10_000, worlds=50):
    """Results of some unseen episodes: ``[episodes]``, whether the robot held the object above the table for HELD steps without a
    break, and whether the training contained all words of the instruction."""
    results = mjs.evaluate(
        "pick",
        "franka",
        Follower(network),
        out=out,
        overwrite=True,
        episodes=episodes,
        scene=chosen.scene,
        seed=seed,
        num_worlds=min(worlds, episodes),
        arm_controller=CONTROLLER,
        horizon=STEPS,
        width=WIDTH,
        height=HEIGHT,
        camera_system="close_up",
        shading=chosen.judged_shading or chosen.shading,
        samples_per_pixel=chosen.samples_per_pixel,
        instructions="canonical",
        terminate_upon_success=False,
    )
    played = results.dataset.episodes
    won = [np.convolve(episode["success"], np.ones(HELD)).max() >= HELD for episode in played]
    known = [set(sentence(episode).split()) <= set(network.vocabulary) for episode in played]
    return np.array(won), np.array(known)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--episodes", type=int, default=200, help="Number of demonstrations.")
    arguments.add_argument("--steps", type=int, default=3500, help="Number of training steps.")
    arguments.add_argument("--judged", type=int, default=200, help="Number of unseen episodes.")
    arguments.add_argument("--shading", default="classic", help="Images of the demonstrations: classic, pbr or path.")
    arguments.add_argument("--judged-shading", help="Images of the unseen episodes; by default those of the demonstrations.")
    arguments.add_argument("--samples-per-pixel", type=int, default=16, help="Paths per pixel of images with shading path.")
    arguments.add_argument("--scene", default="", help="Scene of the unseen episodes; by default the task's.")
    arguments.add_argument("--data", type=Path, help="Recording to read instead of a new one.")
    arguments.add_argument("--out", type=Path, default=Path("pictures"), help="Folder of the network and of the results.")
    arguments.add_argument("--network", type=Path, help="File of a trained network, which is only evaluated.")
    chosen = arguments.parse_args()
    torch.set_num_threads(1)  # the networks are small
    network = loaded(chosen.network) if chosen.network else trained(chosen)
    won, known = evaluate(network, chosen.judged, chosen.out / "trained", chosen)
    low, high = wilson(won.sum(), len(won))
    print(f"trained: {won.sum()} of {len(won)} unseen episodes ({low:.0%} to {high:.0%})", flush=True)
    if not known.all():
        print(
            f"  {won[~known].sum()} of {np.sum(~known)} whose instructions have unknown words, {won[known].sum()} "
            f"of {known.sum()} others"
        )


def trained(chosen):
    """A network trained on the chosen demonstrations."""
    with tempfile.TemporaryDirectory() as out:
        data = Demonstrations(chosen.data or record(out, chosen.episodes, chosen.shading), chosen.episodes)
    print(f"{chosen.episodes} demonstrations, {len(data.state)} steps", flush=True)
    network = new_network(data)
    won, _ = evaluate(network.eval(), min(50, chosen.judged), chosen.out / "untrained", chosen)
    print(f"untrained: {won.mean():.0%}", flush=True)
    train(network, data, chosen.steps)
    torch.save({"vocabulary": network.vocabulary, "weights": network.state_dict()}, chosen.out / "network.pt")
    return network


if __name__ == "__main__":
    main()
