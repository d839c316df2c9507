"""Images a second of CPU time: ours beside MuJoCo's classic renderer (EGL, llvmpipe), poses changed before every frame.

The classic renderer runs in one process a CPU at a time, without multisampling (its fastest setting); we in one process with as
many threads. CPU time of all threads is counted, so that other work on the machine does not decide. Rendering alone is timed:
physics and mj_forward are not, updating our ray scene and MuJoCo's mjvScene are.
"""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")  # one process a CPU: llvmpipe's own threads would only be in the way

import multiprocessing
import statistics
import sys
import time

import camera_scenes
import mujoco
from harness import Row, report

SIZES = ((84, 84), (224, 224), (640, 480))
GOALS = {  # rgb with shadows, depth
    "panda": ((90, 20, 6), (35, 10, 4)),
    "kitchen": ((180, 45, 12), (18, 6, 3)),
    "go1": ((110, 30, 7), (20, 7, 3)),
}
CAMERAS = {"panda": "view", "kitchen": "view", "go1": "head"}
PROCESSES = len(os.sched_getaffinity(0))
RUNS = 5


def classic_worker(name: str, size: tuple[int, int], kind: str, barrier, results) -> None:
    camera_scenes.need_opengl()
    model = getattr(camera_scenes, name)().compile()
    model.vis.quality.offsamples = 0
    width, height = size
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, height, width)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    if kind == "depth":
        renderer.enable_depth_rendering()
    seconds = []
    for run in range(RUNS + 1):
        data.qpos[:] += 1e-3
        mujoco.mj_forward(model, data)
        barrier.wait()
        start = time.process_time()
        renderer.update_scene(data, CAMERAS[name], scene_option=option)
        renderer.render()
        if run:
            seconds.append(time.process_time() - start)
    results.put(statistics.median(seconds))


def classic(name: str, size: tuple[int, int], kind: str) -> float:
    context = multiprocessing.get_context("spawn")
    barrier, results = context.Barrier(PROCESSES), context.Queue()
    args = (name, size, kind, barrier, results)
    workers = [context.Process(target=classic_worker, args=args) for _ in range(PROCESSES)]
    for worker in workers:
        worker.start()
    seconds = [results.get() for _ in workers]
    for worker in workers:
        worker.join()
    return len(seconds) / sum(seconds)


def ours(name: str, size: tuple[int, int], kind: str) -> float:
    import mjsense as mjs

    worlds = 8 * PROCESSES
    camera = mjs.CameraSensorCfg(
        name="cam", camera_name=f"w/{CAMERAS[name]}", width=size[0], height=size[1], data_types=(kind,), use_shadows=True
    )
    entity = mjs.EntityCfg(model=getattr(camera_scenes, name)())
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": entity}, sensors=(camera,)))
    sim = mjs.Simulation(scene, num_worlds=worlds, threads=PROCESSES)
    seconds = []
    for run in range(RUNS + 1):
        sim.qpos[:] += 1e-3
        sim.forward()
        start = time.process_time()
        sim.refresh([scene["cam"]])
        if run:
            seconds.append(time.process_time() - start)
    return worlds / statistics.median(seconds)


def main() -> None:
    names = [n for n in GOALS if n in sys.argv] or list(GOALS)
    rows = []
    for name in names:
        for index, size in enumerate(SIZES):
            for goals, kind in zip(GOALS[name], ("rgb", "depth")):
                text = f"{name} {size[0]}x{size[1]} {kind}{' with shadows' if kind == 'rgb' else ''}"
                peer = classic(name, size, kind)
                rows.append(Row(text, ours(name, size, kind), "frames/CPU s", peer, "classic", goal=goals[index]))
                print(f"{text}: {rows[-1].ours:.0f} against {peer:.1f}", file=sys.stderr)
    report("Cameras", rows)


if __name__ == "__main__":
    main()
