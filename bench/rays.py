# SPDX-License-Identifier: Apache-2.0
"""Height scans and a lidar compared with mj_ray, mj_multiRay, mujoco_warp (the engine of mjlab's ray sensors) and mujoco-lidar on
the CPU; the update of a world's top-level BVH; scenes of increasing size; and threads. Runs lidar_bench.cc, height_scan_bench.cc
and ray_scene_bench.cc as one program.

The pose of the robot, joints included, changes before every scan. Only the rays and the update of the ray scene are measured. The
robots are mjlab's Go1 and G1. Peers written in Python run in separate environments (fetch.py) on scenes that mjsense_bench saved.
Rates are per CPU second of one core, so that other load affects both sides alike.
"""

import pathlib
import sys
import tempfile

from fetch import Unavailable, run_peer, wheel
from harness import Row, google_benchmarks, report, run_program


def robots() -> dict[str, str]:
    """Environment variables that make the program use mjlab's robots instead of its stand-ins."""
    try:
        folder = wheel("mjlab") / "mjlab/asset_zoo/robots"
    except Unavailable as error:
        print(f"rays: using stand-ins for the Go1 and the G1: {error}", file=sys.stderr)
        return {}
    return {
        "MJSENSE_BENCH_QUADRUPED": f"{folder}/unitree_go1/xmls/go1.xml",
        "MJSENSE_BENCH_HUMANOID": f"{folder}/unitree_g1/xmls/g1.xml",
    }


def rate(m: dict) -> float:
    return m["items"] / m["cpu"] * 1e3


def peer(models: dict[str, str], benchmark: str, script: str, *kind: str) -> float | None:
    """Million rays per CPU second of a peer in the scene of this benchmark; None, after printing the reason, if it is not
    available."""
    with tempfile.TemporaryDirectory() as folder:
        scene = str(pathlib.Path(folder) / "scene.mjb")
        run_program(
            "mjsense_bench", f"--benchmark_filter={benchmark}$", "--benchmark_min_time=0.01", MJSENSE_BENCH_SAVE=scene, **models
        )
        try:
            return run_peer("warp", script, scene, *kind)["rays_per_second"] * 1e-6
        except Unavailable as error:
            print(f"rays: {script} skipped: {error}", file=sys.stderr)
            return None


def main() -> None:
    models = robots()
    m = google_benchmarks("height_scan|lidar|top_level|among_boxes", **models)
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
        rows.append(
            Row(
                f"{case}, two threads and one",
                m[f"{name}/2"]["real"] * 1e-3,
                "us",
                m[f"{name}/1"]["real"] * 1e-3,
                "one thread",
                higher_is_better=False,
                goal=1.9,
            )
        )
    many = "lidar in 16 worlds, a step of physics (not timed) between"
    rows.append(Row(many, rate(m["lidar_worlds"]), unit, rate(m["lidar_worlds_mj_multiRay"]), "mj_multiRay", goal=5))
    for count in (100, 1000, 10000):
        ours = rate(m[f"among_boxes/{count}"])
        for name, column in (("mj_multiRay", "mj_multiRay"), ("of_one_mesh", "ours, the boxes as one mesh")):
            rows.append(
                Row(f"lidar among {count:,} boxes and one that moves", ours, unit, rate(m[f"among_boxes_{name}/{count}"]), column)
            )
        rows.append(Row(f"- bringing the {count:,} up to date", m[f"among_boxes_update/{count}"]["cpu"] * 1e-3, "us"))
    for pose in ("moving", "still"):
        top = m[f"top_level/{pose}"]
        rows.append(Row(f"top level of a world of {top['geoms']:.0f} geoms, the robot {pose}", top["cpu"] * 1e-3, "us"))
    report("Rays", rows)


if __name__ == "__main__":
    main()
