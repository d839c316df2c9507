# SPDX-License-Identifier: Apache-2.0
"""Writing and encoding: the recorder of mjsense compared with a sequential writer in Python (h5py and ffmpeg) that works like
MolmoSpaces'.

Both get the same images and rows, which are made before the measurement, and both produce complete files. The peer keeps an
episode in memory, then encodes its cameras one after the other (x264 with its default number of threads), encodes the dict
rows as JSON, and stacks and writes everything with lzf; it does not sync. It stores depth in the lossy red-green form. mjsense
writes while the episode runs, with one thread per encoder, lossless depth and synced files.
"""

import json
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile

import h5py
import numpy as np
from harness import Row, median_seconds, program, report

WIDTH, HEIGHT = 640, 368
PEER = "h5py and ffmpeg in sequence"
JSON_STREAMS = {f"actions/{k}": 2000 for k in ("commanded_action", "ee_pose", "ee_twist", "joint_pos", "joint_pos_rel")} | {
    "obs/agent/qpos": 2000,
    "obs/agent/qvel": 2000,
    "obs/extra/task_info": 4000,
    "obs/extra/grasp_state_pickup_obj": 2000,
}


def pictures(steps: int) -> np.ndarray:
    """The same images as those of record_fake, for the peer: uint8 [steps, HEIGHT, WIDTH, 3]."""
    x, y, t = np.arange(WIDTH), np.arange(HEIGHT)[:, None], np.arange(steps)[:, None, None]
    ball = (x - 2 * t - 8) ** 2 + (y - HEIGHT // 2) ** 2 < HEIGHT * HEIGHT // 16
    red = np.where(ball, 220, 40 + 120 * x // WIDTH)
    green = np.where(ball, 60, 60 + 100 * y // HEIGHT)
    blue = np.where(ball, 40, 120)
    return np.stack([red, green, blue], -1).astype(np.uint8)


def depth(steps: int) -> np.ndarray:
    x, y, t = np.arange(WIDTH), np.arange(HEIGHT)[:, None], np.arange(steps)[:, None, None]
    return (0.3 + 0.001 * (x + 2 * y + t)).astype(np.float32)


def encode(frames: np.ndarray, path: pathlib.Path, codec: list[str]) -> None:
    command = [
        "ffmpeg",
        "-y",
        "-v",
        "error",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{WIDTH}x{HEIGHT}",
        "-r",
        "15.15",
        "-i",
        "-",
    ]
    process = subprocess.Popen([*command, *codec, path], stdin=subprocess.PIPE)
    assert process.stdin
    for frame in frames:
        process.stdin.write(frame.tobytes())
    process.stdin.close()
    assert process.wait() == 0


def red_green(metres: np.ndarray) -> np.ndarray:
    inside = (metres >= 0.05) & (metres <= 0.55)
    code = np.where(inside, (metres - 0.05) / 0.5 * 65534 + 1, 0).astype(np.uint16)
    return np.stack([code >> 8, code & 255, np.zeros_like(code)], -1).astype(np.uint8)


def peer_writes(out: pathlib.Path, rgb: list[np.ndarray], depths: list[np.ndarray], rows: list[dict], episodes: int) -> None:
    with h5py.File(out / "trajectories.h5", "w") as f:
        for e in range(episodes):
            for c, frames in enumerate(rgb):
                encode(frames, out / f"episode_{e}_{c}.mp4", ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "25"])
            for c, metres in enumerate(depths):
                encode(red_green(metres), out / f"episode_{e}_{c}_depth.mp4", ["-c:v", "libx264rgb", "-crf", "23"])
            for name, size in JSON_STREAMS.items():
                stacked = []
                for row in rows:
                    text = json.dumps(row, sort_keys=True, separators=(",", ":")).encode()
                    padded = np.zeros(size, np.uint8)
                    padded[: len(text)] = np.frombuffer(text, np.uint8)
                    stacked.append(padded)
                f.create_dataset(f"traj_{e}/{name}", data=np.stack(stacked), compression="lzf")
            for name in ("robot_base_pose", "obj_start", "tcp_pose", "grasp_pose"):
                f.create_dataset(f"traj_{e}/obs/extra/{name}", data=np.zeros((len(rows), 7), np.float32), compression="lzf")


def processor_seconds() -> float:
    """CPU seconds of this process and of its finished child processes."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def main() -> None:
    table = []
    split = None
    for steps, episodes, with_depth in ((100, 1, False), (100, 1, True), (500, 1, False), (100, 4, False)):
        rgb, metres = [pictures(steps)] * 2, [depth(steps)] * (2 if with_depth else 0)
        rows = [{"arm": list(np.sin(0.1 * t + np.arange(7))), "base": [], "gripper": [0.00296]} for t in range(steps)]
        scratch = pathlib.Path(tempfile.mkdtemp())
        command = [
            program("record_fake"),
            scratch / "ours",
            "--measure",
            "--cameras",
            2,
            "--steps",
            steps,
            "--episodes",
            episodes,
            "--worlds",
            episodes,
            "--width",
            WIDTH,
            "--height",
            HEIGHT,
            *([] if with_depth else ["--no-depth"]),
        ]
        walls, peer_cpu = [], []

        def ours():
            shutil.rmtree(scratch / "ours", ignore_errors=True)
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
            walls.append(json.loads(done.stdout))

        def peer():
            before = processor_seconds()
            shutil.rmtree(scratch / "peer", ignore_errors=True)
            (scratch / "peer").mkdir()
            peer_writes(scratch / "peer", rgb, metres, rows, episodes)
            peer_cpu.append(processor_seconds() - before)

        _, peer_s = median_seconds(ours, peer, runs=5)
        walls = sorted(walls[1:], key=lambda w: w["wall_s"])
        split = walls[len(walls) // 2]
        case = f"{episodes} x {steps} steps, 2 RGB{' + 2 depth' if with_depth else ''}, {WIDTH}x{HEIGHT}"
        table.append(Row(case, split["frames"] / split["wall_s"], "frames/s", split["frames"] / peer_s, PEER))
        # CPU time is comparable even if other programs use the machine.
        ours_cpu = sum(split[k] for k in ("copy_s", "write_s", "encode_cpu_s"))
        per_frame = 1000 / split["frames"]
        table.append(
            Row("- processor time", ours_cpu * per_frame, "ms/frame", statistics.median(peer_cpu[1:]) * per_frame, PEER, False)
        )
        parts = ", ".join(f"{k[:-2]} {split[k]:.3f}" for k in ("copy_s", "wait_s", "write_s", "commit_s", "encode_cpu_s"))
        print(f"{case}: wall {split['wall_s']:.3f} s, of it {parts}; {split['disk_bytes'] / 1e6:.2f} MB", file=sys.stderr)
        shutil.rmtree(scratch)
    report("Recording: HDF5 + video", table)


if __name__ == "__main__":
    main()
