"""Height scans and a lidar beside mj_ray and mj_multiRay, the update of a world's top level, and threads: lidar_bench.cc and
height_scan_bench.cc, run as one program.

$MJSENSE_BENCH_QUADRUPED and $MJSENSE_BENCH_HUMANOID name MJCFs (a Go1's and a G1's, as mjlab's wheel has them) to stand in for the
built-in robots. With $MJSENSE_PEERS, the Python of an environment with mujoco-lidar and mujoco_warp, the engine under mjlab's ray
sensors (peers/), those are measured in the same scenes. Rates count processor time of one core, so that a busy machine counts for both sides alike.
"""

import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

from harness import Row, report

ROOT = pathlib.Path(__file__).resolve().parents[1]
RUNS = 5


def program() -> str:
    built = [ROOT / "build" / preset / "mjsense_bench" for preset in ("release", "dev")]
    found = next((str(p) for p in built if p.exists()), None)
    if not found:
        sys.exit("bench/rays: build the benchmarks first (cmake --preset release, cmake --build --preset release)")
    return found


def measure() -> dict[str, dict]:
    """Medians of real and CPU nanoseconds, and rays of one iteration, by benchmark."""
    command = [program(), "--benchmark_filter=height_scan|lidar|top_level", "--benchmark_format=json", "--benchmark_min_time=0.2",
               f"--benchmark_repetitions={RUNS}", "--benchmark_enable_random_interleaving=true"]
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    runs: dict[str, list[dict]] = {}
    for run in json.loads(text[text.index("{"):])["benchmarks"]:
        if run["run_type"] == "iteration":
            runs.setdefault(run["run_name"].removesuffix("/real_time"), []).append(run)
    medians = {}
    for name, same in runs.items():
        real, cpu = (statistics.median(r[k] for r in same) for k in ("real_time", "cpu_time"))
        # items_per_second counts real time where that was asked for.
        per_second = statistics.median(r.get("items_per_second", 0.0) for r in same)
        counted = real if "/real_time" in same[0]["name"] else cpu
        medians[name] = {"real": real, "cpu": cpu, "rays": per_second * counted * 1e-9}
    return medians


def rate(m: dict) -> float:
    return m["rays"] / m["cpu"] * 1e3


def peer(script: str, benchmark: str, *args: str) -> float | None:
    """M rays per CPU second of a peer in the scene of this benchmark; None without $MJSENSE_PEERS."""
    python = os.environ.get("MJSENSE_PEERS")
    if not python:
        return None
    with tempfile.TemporaryDirectory() as folder:
        scene = os.path.join(folder, "scene.mjb")
        subprocess.run([program(), f"--benchmark_filter={benchmark}", "--benchmark_min_time=0.01"], check=True,
                       env={**os.environ, "MJSENSE_BENCH_SAVE": scene}, capture_output=True)
        path = ROOT / "bench" / "peers" / f"{script}.py"
        lines = subprocess.run([python, str(path), scene, *args], check=True, capture_output=True, text=True).stdout.splitlines()
        return float(lines[-1].split()[0]) * 1e-6


def main() -> None:
    m = measure()
    unit = "M rays per CPU second"
    rows = []
    for case, scene, scripts in (
        ("187 rays, 64 worlds, height field 128 x 128", "height_field", {"mujoco_warp": "height"}),
        ("187 rays, 64 worlds, 94 boxes", "boxes", {"mujoco_warp": "height"}),
        ("lidar 16 x 360 in a room, humanoid of meshes", "", {"mujoco_warp": "lidar", "mujoco_lidar": "lidar"}),
    ):
        ours = rate(m[f"height_scan/{scene}/1" if scene else "lidar/1"])
        mujoco = f"height_scan_mj_ray/{scene}" if scene else "lidar_mj_multiRay"
        rows.append(Row(case, ours, unit, rate(m[mujoco]), "mj_ray" if scene else "mj_multiRay", goal=5))
        for script, kind in scripts.items():
            other = peer(script, mujoco, kind)
            if other is not None:
                rows.append(Row(case, ours, unit, other, f"{script} on the CPU", goal=5))
    for name, case in (("height_scan/boxes", "height scan, boxes"), ("lidar", "lidar")):
        rows.append(Row(f"{case}, two threads and one", m[f"{name}/2"]["real"] * 1e-3, "us", m[f"{name}/1"]["real"] * 1e-3,
                        "one thread", higher_is_better=False, goal=1.9))
    rows.append(Row("top level of a world of 107 geoms", m["top_level"]["cpu"] * 1e-3, "us", 5.0, "goal", higher_is_better=False, goal=1))
    report("Rays", rows)


if __name__ == "__main__":
    main()
