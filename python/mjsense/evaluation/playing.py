# SPDX-License-Identifier: Apache-2.0
"""Evaluation of a policy: given episodes of a task are played and recorded, each once, and their results are counted."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from mjsense import _core
from mjsense.core.arguments import Seed, checked
from mjsense.evaluation.benchmarks import Benchmark, is_benchmark
from mjsense.evaluation.facts import FILE
from mjsense.evaluation.molmospaces_benchmark import MolmoSpacesBenchmark, is_molmospaces
from mjsense.evaluation.policies import policy_from
from mjsense.evaluation.replayed import ReplayedPolicy
from mjsense.evaluation.report import Results, require_parquet, results
from mjsense.evaluation.timing import Latency, timed
from mjsense.recording.existing import require_no_recording
from mjsense.tasks.code_checksums import checksums
from mjsense.tasks.parts import Robots, Scenes, Tasks
from mjsense.tasks.policy import Policy
from mjsense.tasks.record_job import RecordProgress, record_here
from mjsense.tasks.recording import record
from mjsense.tasks.vector import checked_episodes


@checked
def evaluate(
    task: Tasks | Path = "pick",
    robot: Robots | None = None,
    policy: Any = "planner",
    *,
    out: str | Path,
    episodes: int | Sequence[int] = 50,
    scene: Scenes = "",
    policy_options: Mapping[str, Any] | None = None,
    execution_horizon: int | None = None,
    ensemble: float | None = None,
    latency: float | Literal["measured"] = 0.0,
    # options of a recording
    arm_controller: str = "",
    split: Literal["", "train", "test"] = "",
    backdrop: str = "",
    num_worlds: int = 4,
    threads: int = 0,
    seed: Seed = 0,
    camera_system: str = "",
    cameras: Sequence[str] | None = None,
    width: int | None = None,
    height: int | None = None,
    depth: bool = False,
    segmentation: bool = False,
    shadows: bool = True,
    samples: int = 1,
    shadow_samples: int = 1,
    shading: Literal["classic", "pbr", "path"] = "classic",
    samples_per_pixel: int = 64,
    exposure: float = 8.0,
    exposure_mode: Literal["fixed", "auto"] = "fixed",
    exposure_time_constant: float = 0.5,
    imager: Literal["none", "d435", "zed_mini"] = "none",
    motion_samples: int = 8,
    tone_mapping: Literal["neutral", "filmic", "linear", "agx"] = "filmic",
    white_balance: float = 6504.0,
    environment: str = "model",
    environment_intensity: float = 1.0,
    environment_rotation: float = 0.0,
    ambient_occlusion: bool = True,
    meshes: Literal["auto", "shapes", "real"] = "auto",
    horizon: int | None = None,
    policy_dt_ms: int | None = None,
    perturb: float = 0.0,
    instructions: Literal["varied", "canonical"] = "varied",
    terminate_upon_success: bool = True,
    max_penetration: float | None = None,
    resume: bool = False,
    overwrite: bool = False,
    house: int = 0,
    batches: int = 0,
    gzip: int = 4,
    ffmpeg: str = "",
    crf: int = 25,
    preset: str = "veryfast",
    tune: str = "fastdecode",
    keyint: int = 20,
    molmospaces_depth: bool = False,
    replay: bool = True,
    videos: bool = True,
    # end of options
    sensors: Iterable[Any] = (),
    ray: str | None = None,
    progress: bool | Callable[[RecordProgress], None] | None = None,
) -> Results:
    """Plays episodes of a task with a policy, each once, and returns their results.

    Every episode is recorded into ``out/house_<house>/``, failed ones too, as :func:`mjsense.record` does: it can be viewed,
    replayed and exported. ``out/results.parquet`` and ``out/report.html`` are the results, and ``out/evaluation.json`` says what
    was evaluated. There is no action noise. The starts depend only on the seed and the number of the episode, and so do the
    results of a policy that is a function of its observations. An interrupted evaluation continues with ``resume=True``.

    Args:
        task: A :class:`Task`, its class, a registered name (:func:`task_names`), or a benchmark, which fixes all options that
            affect the data: its folder, or ``benchmark:pick`` and similar, which the package contains.
        robot: A registered name (:func:`robot_names`), the path of a ``.toml``, or a :class:`Robot`; by default the task's robot.
        policy: A :class:`Policy`, a class or object with ``act`` (:class:`mjsense.evaluation.BatchedPolicy`), a function
            ``obs -> actions``, or a text: a registered name (:func:`policy_names`), ``random``, ``replay:DIR``, ``lerobot:DIR``,
            ``python:MODULE:CLASS`` or ``FILE.py:CLASS``.
        out: Output directory.
        episodes: Number of episodes, which are then those from 0 on, or a list of their numbers. A benchmark states them itself.
        scene: A name, a file, a :class:`SceneFileCfg`, or a function that returns a :class:`SceneCfg`; by default the task's
            scene.
        policy_options: Arguments of the policy's class.
        execution_horizon: Number of actions of a chunk that are executed before the policy is called again; by default all.
        ensemble: The executed action is the mean of all chunks that have one for the step, with the weights
            ``exp(-ensemble * i)``, ``i = 0`` for the oldest; by default that of the newest chunk.
        latency: Time from an observation until the actions that answer it are executed, rounded up to control steps;
            ``measured``: the wall-clock time that the policy needs for all worlds, with which results vary. [s]

        Options:
        arm_controller: Controller of the robot's arms, which decides what an action is: its kind, for example
            ``ee_delta_pose``, or a TOML table with its fields; by default that of the robot's file.
        split: Part of the scene: ``train`` or ``test``, which have no kind of object in common; the same as ``@train``
            or ``@test`` after the scene's name.
        backdrop: Surroundings of the scene that are only seen, an MJCF, .glb, .gltf or .obj file: nothing touches its
            geoms.
        num_worlds: Number of worlds that run in parallel.
        threads: Number of simulation threads; 0: one per available CPU.
        seed: Random seed; the same seed gives the same episodes.
        camera_system: Name or file of the camera system; by default the cameras of the robot's model.
        cameras: Names of the cameras to render, in this order; by default all, an empty list renders none.
        width: Width of the images; by default each camera's. ``width`` or ``height`` alone keeps the aspect ratio.
            [pixels]
        height: Height of the images; by default each camera's. [pixels]
        depth: Add a lossless depth image for every camera.
        segmentation: Add a lossless segmentation image for every camera: (id, mjtObj) of each pixel.
        shadows: Draw shadows.
        samples: Rays per pixel of rgb; more samples give smoother edges and take longer.
        shadow_samples: Points of each light at which its shadows are computed, within the ball of its ``bulbradius``;
            more than 1 gives soft shadows and takes longer. A view has at most 32 lights and points.
        shading: classic: MuJoCo's light model. pbr: physically based materials, lights and surroundings; depth,
            segmentation and the other images are the same. path: the same by path tracing, which is the reference for
            pbr and takes much longer. The options below belong to pbr and path.
        samples_per_pixel: Paths per pixel with shading path; four times as many halve the noise. ``samples`` and
            ``shadow_samples`` are for the other kinds of shading.
        exposure: Exposure in EV at ISO 100; 1 more halves the brightness.
        exposure_mode: auto: a meter chooses the exposure of each world, instead of ``exposure``.
        exposure_time_constant: Time in which the automatic exposure covers 63 % of a change; 0: it follows at once. [s]
        imager: Colour sensor of a real camera: photon and read noise, vignetting, quantisation, motion blur and rolling
            shutter.
        motion_samples: Instants of an exposure of which an image with ``imager`` is the mean, where something moves; 0:
            neither motion blur nor rolling shutter.
        tone_mapping: From radiance to colours. neutral: keeps the colours of materials; filmic: soft contrast; linear:
            clips; agx: bright colours become white.
        white_balance: Colour temperature of the light that appears white. [K]
        environment: Light from the surroundings. model: the model's image light, else studio; auto: its image light,
            else its skybox, else studio; skybox: its skybox; studio: a neutral bright room; or the path of an .hdr or
            .exr file, which is also the background.
        environment_intensity: Factor of the light from the surroundings.
        environment_rotation: Rotation of the surroundings about the world's z axis; a skybox in the background does not
            rotate. [degrees]
        ambient_occlusion: Darken the light from the surroundings where other geoms are near.
        meshes: Geometry used to draw the robot: ``shapes`` (primitives), ``real`` (its meshes), or ``auto``: the meshes
            if the robot's environment variable (``MJSENSE_FRANKA_MESHES``) names their folder. Physics is not affected.
        horizon: Maximum number of control steps of an episode; by default the task's.
        policy_dt_ms: Duration of one action of the policy, a multiple of the controllers' period; by default the
            robot's or the task's. 50 ms gives 20 observations per second. [ms]
        perturb: Fraction of episodes that are disturbed on purpose: the object is pushed, or slips from the gripper.
        instructions: Instruction of each episode. ``varied``: paraphrases that describe the objects by what
            distinguishes them in that episode; ``canonical``: one sentence per task and object.
        terminate_upon_success: End an episode at its first success.
        max_penetration: Depth of a contact. After an observation with a deeper one, the episode is not a success; 0:
            any depth. By default 4 mm in built-in tasks, and any depth in user-defined ones. Pairs of geoms that are
            deeper at the start do not count. [m]
        resume: Continue an interrupted recording; all settings that affect the data must be unchanged.
        overwrite: Replace an existing recording of this house.
        house: Number of the ``house_N`` folder in the output directory. Each house of a task has its own random
            numbers.
        batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
        gzip: Compression level of arrays, 0 to 9.
        ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst).
        preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.
        tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
            seventh larger.
        keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
            makes files smaller.
        molmospaces_depth: Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video.
        replay: Store what replay needs: the model, and the simulation's state and controls of every step.
        videos: Store the images of the cameras as videos. Without them, ``mjsense render`` makes the videos of chosen
            episodes afterwards.
        Others:
        sensors: Additional sensors, as in :func:`mjsense.record`.
        ray: ``local``, ``auto`` or the address of a Ray cluster, as in :func:`mjsense.record`.
        progress: True: shows the progress on stderr. A function: called with the progress about ten times per second. By default
            True where stderr is a terminal or a notebook.
    """
    options = dict(locals())
    arguments = {
        name: options.pop(name)
        for name in ("policy", "policy_options", "execution_horizon", "ensemble", "latency", "sensors", "ray", "progress")
    }
    return play(options, **arguments)


def play(
    options: dict[str, Any],
    policy: Any,
    *,
    policy_options: Mapping[str, Any] | None = None,
    execution_horizon: int | None = None,
    ensemble: float | None = None,
    latency: Latency = 0.0,
    sensors: Iterable[Any] = (),
    ray: str | None = None,
    progress: bool | Callable[[RecordProgress], None] | None = None,
) -> Results:
    """See :func:`evaluate`.

    Args:
        options: ``task``, ``out``, ``episodes``, and those options of a recording that differ from the defaults.
    """
    require_parquet()
    out, spec = Path(options["out"]), policy if isinstance(policy, str) else None
    benchmark = _benchmark_of(options)
    made = policy_from(policy, **(policy_options or {}))
    noise = False
    jobs = _jobs(benchmark, options, ray)
    if ray is None and not options.get("resume") and not options.get("overwrite"):
        for job, _ in jobs:
            require_no_recording(out / f"house_{job.get('house', 0)}", "resume it", "overwrite it")
    numbers = [number for job, played in jobs for number in (range(played) if isinstance(played, int) else played)]
    if isinstance(made, ReplayedPolicy):
        if len(jobs) > 1:
            raise ValueError(f"replay: '{options['task']}' has episodes of {len(jobs)} kinds, and a recording is of one kind")
        made.check(_settings(jobs[0][0]), numbers)
        noise = bool(made.settings.get("action_noise", False))
    made, timing = timed(made, execution_horizon, ensemble, latency)
    if isinstance(benchmark, Benchmark):
        benchmark.check_starts(int(options.get("num_worlds", 4)))
    about = {
        "policy": {"spec": spec, "name": made if isinstance(made, str) else made._mjs_name(), "fingerprint": fingerprint(made)},
        "benchmark": None if benchmark is None else {"name": benchmark.name, "checksum": benchmark.checksum},
        "settings": timing,
        "episodes": jobs[0][1] if len(jobs) == 1 and isinstance(jobs[0][1], int) else numbers,
    }
    begun = time.perf_counter()
    is_new = not any(out.glob("house_*/*"))
    not_played: dict[str, int] = {}
    try:
        for job, _ in jobs:
            job |= {"policy": made, "action_noise": noise, "keep_failures": True}
            not_played |= _record(job, sensors, ray, progress)
    except Exception as error:
        if (is_new or options.get("resume")) and any(out.glob("house_*/*")):
            error.add_note(f"The finished episodes are in '{out}'; resume the evaluation to play the others.")
        raise
    _write(out, {**about, "wall_s": round(time.perf_counter() - begun, 3)})
    found = results(out)
    found.write(out)
    if isinstance(benchmark, MolmoSpacesBenchmark) and len(found.rows) < len(numbers):
        ended = {row.failure for row in found.rows}
        played = {reason for reason in not_played if reason.partition(" (")[0] in ended}
        reasons = "; ".join(f"{count}: {reason}" for reason, count in not_played.items() if reason not in played)
        raise ValueError(
            f"benchmark '{benchmark.folder}': {len(numbers) - len(found.rows)} of {len(numbers)} episodes cannot be played"
            f"{f': {reasons}' if reasons else ''}; the results of the others are in '{out}'"
        )
    return found


def _benchmark_of(options: Mapping[str, Any]) -> Benchmark | MolmoSpacesBenchmark | None:
    task = options["task"]
    if not is_benchmark(task):
        return None
    if not is_molmospaces(task):
        return Benchmark(task)
    scene = options.get("scene") or ""
    if not isinstance(scene, (str, Path)):
        raise ValueError("evaluate: the scene of a benchmark of MolmoSpaces must be a name or a file")
    return MolmoSpacesBenchmark(task, str(scene))


def _jobs(
    benchmark: Benchmark | MolmoSpacesBenchmark | None, options: Mapping[str, Any], ray: str | None
) -> list[tuple[dict[str, Any], int | list[int]]]:
    """Options of each recording, and the numbers of its episodes."""
    options = dict(options)
    given: int | Sequence[int] = options.pop("episodes", 50)
    if isinstance(benchmark, MolmoSpacesBenchmark):
        if ray is not None:
            raise ValueError("evaluate: a benchmark of MolmoSpaces cannot be played with ray")
        jobs = benchmark.jobs(options)
        for job in jobs:
            if job.get("resume") and not (Path(job["out"]) / f"house_{job['house']}").exists():
                del job["resume"]  # it was not begun
        return [(job, job["attempts"]) for job in jobs]
    if benchmark is not None:
        options, given = benchmark.options(options), benchmark.episodes
    return [({**options, **_attempts(given, ray)}, given if isinstance(given, int) else list(given))]


def _record(job: dict[str, Any], sensors: Iterable[Any], ray: str | None, progress: Any) -> dict[str, int]:
    """Records, and returns the reasons of failures."""
    if "starts" in job:
        return record_here(job, sensors, progress).failures
    record(**job, sensors=sensors, ray=ray, progress=progress)
    return {}


def _attempts(numbers: int | Sequence[int], ray: str | None) -> dict[str, Any]:
    """The options of ``record`` that play these episodes."""
    if isinstance(numbers, int):
        if numbers < 1:
            raise ValueError(f"evaluate: episodes is {numbers}: must be at least 1")
        return {"num_attempts": numbers} if ray is None else {"episodes": numbers, "max_attempts": numbers}
    listed = sorted(checked_episodes("evaluate", numbers))
    if listed == list(range(len(listed))):
        return _attempts(len(listed), ray)
    return {"attempts": listed}


def _settings(options: Mapping[str, Any]) -> dict[str, Any]:
    """Settings that a replayed recording must share, as recordings state them."""
    names = {name: options[name] for name in ("task", "robot", "scene", "split") if options.get(name) is not None}
    found = {"seed": 0, "arm_controller": "", "perturb": 0.0, "instructions": "varied"}
    found = {name: options.get(name, value) for name, value in found.items()}
    if all(isinstance(value, str) for value in names.values()):
        found["task"], found["robot"], found["scene"], _, _ = _core.resolved_job({**names, "out": "."})
    return found


def fingerprint(policy: Policy | str) -> str:
    """Checksum of a policy's code and values, or of its name and the version of mjsense."""
    if isinstance(policy, str):
        parts: Any = [policy, _core.__version__]  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
    else:
        parts = checksums(policy, "policy")
    return "sha256:" + hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _write(out: Path, about: dict[str, Any]) -> None:
    part = out / f".{FILE}.part"
    part.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    os.replace(part, out / FILE)
