"""Height scans and a lidar beside mj_ray, mj_multiRay, mujoco_warp (the engine under mjlab's ray sensors) and mujoco-lidar on the CPU, the
update of a world's top level, and threads: lidar_bench.cc and height_scan_bench.cc, run as one program.

The robots are mjlab's Go1 and G1. Peers of Python run in an environment of their own (fetch.py) in the scenes that our program saved. Rates
count processor time of one core, so that a busy machine counts for both sides alike.
"""

import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

from fetch import Unavailable, run_peer, wheel
from harness import Row, program, report

RUNS = 5


def robots() -> dict[str, str]:
    """What tells the program to use mjlab's robots instead of its stand-ins."""
    try:
        folder = wheel("mjlab") / "mjlab/asset_zoo/robots"
    except Unavailable as error:
        print(f"rays: stand-ins for the Go1 and the G1, for {error}", file=sys.stderr)
        return {}
    return {"MJSENSE_BENCH_QUADRUPED": f"{folder}/unitree_go1/xmls/go1.xml", "MJSENSE_BENCH_HUMANOID": f"{folder}/unitree_g1/xmls/g1.xml"}


def bench(*options: str, **environment: str) -> str:
    command = [program("mjsense_bench"), *options]
    environment = {**os.environ, **environment}
    return subprocess.run(command, check=True, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout


def measure(models: dict[str, str]) -> dict[str, dict]:
    """Medians of real and CPU nanoseconds, rays of one iteration and the scene's geoms and faces, by benchmark."""
    text = bench("--benchmark_filter=height_scan|lidar|top_level", "--benchmark_format=json", "--benchmark_min_time=0.2",
                 f"--benchmark_repetitions={RUNS}", "--benchmark_enable_random_interleaving=true", **models)
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
        size = {k: same[0].get(k, 0) for k in ("geoms", "faces")}
        medians[name] = {"real": real, "cpu": cpu, "rays": per_second * counted * 1e-9, **size}
    return medians


def rate(m: dict) -> float:
    return m["rays"] / m["cpu"] * 1e3


def peer(models: dict[str, str], benchmark: str, script: str, *kind: str) -> float | None:
    """M rays per CPU second of a peer in the scene of this benchmark; None, and a line that says why, if it cannot be had."""
    with tempfile.TemporaryDirectory() as folder:
        scene = str(pathlib.Path(folder) / "scene.mjb")
        bench(f"--benchmark_filter={benchmark}", "--benchmark_min_time=0.01", MJSENSE_BENCH_SAVE=scene, **models)
        try:
            return run_peer("warp", script, scene, *kind)["rays_per_second"] * 1e-6
        except Unavailable as error:
            print(f"rays: {script} left out: {error}", file=sys.stderr)
            return None


def main() -> None:
    models = robots()
    m = measure(models)
    unit = "M rays per CPU second"
    rows = []
    room = f"lidar 16 x 360 on a humanoid in a room, {m['lidar/1']['geoms']:.0f} geoms, {m['lidar/1']['faces'] / 1000:.0f}k faces"
    for case, scene, peers in (
        ("187 rays, 64 worlds, height field 128 x 128", "height_field", {"mujoco_warp": ("warp_rays", "height")}),
        ("187 rays, 64 worlds, 94 boxes", "boxes", {"mujoco_warp": ("warp_rays", "height")}),
        (room, "", {"mujoco_warp": ("warp_rays", "lidar"), "mujoco-lidar": ("lidar_rays",)}),
    ):
        ours = rate(m[f"height_scan/{scene}/1" if scene else "lidar/1"])
        mujoco = f"height_scan_mj_ray/{scene}" if scene else "lidar_mj_multiRay"
        rows.append(Row(case, ours, unit, rate(m[mujoco]), "mj_ray" if scene else "mj_multiRay", goal=5))
        for name, command in peers.items():
            other = peer(models, mujoco, *command)
            if other is not None:
                rows.append(Row(case, ours, unit, other, f"{name} on the CPU", goal=5))
    for name, case in (("height_scan/boxes", "height scan, boxes"), ("lidar", "lidar")):
        rows.append(Row(f"{case}, two threads and one", m[f"{name}/2"]["real"] * 1e-3, "us", m[f"{name}/1"]["real"] * 1e-3,
                        "one thread", higher_is_better=False, goal=1.9))
    top = m["top_level"]
    case = f"top level of a world of {top['geoms']:.0f} geoms"
    rows.append(Row(case, top["cpu"] * 1e-3, "us", 5.0, "goal", higher_is_better=False, goal=1))
    report("Rays", rows)


if __name__ == "__main__":
    main()
