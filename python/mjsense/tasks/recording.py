# SPDX-License-Identifier: Apache-2.0
"""Recording of episodes: on this machine, on Ray, or converted to another format."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from mjsense.core.arguments import Seed, checked
from mjsense.core.later_rooms import provided
from mjsense.core.old_names import old_argument
from mjsense.tasks.parts import Policies, Robots, Scenes, Tasks
from mjsense.tasks.record_job import RecordProgress, RecordSummary, record_here


@old_argument("worlds", "num_worlds")
@checked
def record(
    task: Tasks = "pick",
    robot: Robots | None = None,
    policy: Policies = "planner",
    *,
    out: str | Path,
    scene: Scenes = "",
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
    action_noise: bool = True,
    perturb: float = 0.0,
    instructions: Literal["varied", "canonical"] = "varied",
    terminate_upon_success: bool = False,
    max_penetration: float | None = None,
    episodes: int = 1,
    resume: bool = False,
    append: bool = False,
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
    max_attempts: int = 0,
    num_attempts: int = 0,
    first_attempt: int = 0,
    attempts: Sequence[int] = (),
    shard: str = "",
    keep_failures: bool = False,
    replay: bool = True,
    videos: bool = True,
    # end of options
    sensors: Iterable[Any] = (),
    format: str = "mjsense",
    map: Any = None,
    trim_idle: bool | None = None,
    keep_recording: bool = False,
    ray: str | None = None,
    progress: bool | Callable[[RecordProgress], None] | None = None,
) -> RecordSummary:
    """Records episodes of a task as HDF5 and MP4 files in ``out/house_<house>/``.

    Which attempts are kept, and every byte of them except the videos' containers, depends only on the seed, not on the number of
    worlds, threads or interruptions. Ctrl-C keeps the finished episodes and raises KeyboardInterrupt; call again with
    ``resume=True`` to continue.

    Args:
        task: A :class:`Task`, its class, or a registered name (:func:`task_names`).
        robot: A registered name (:func:`robot_names`), the path of a ``.toml``, or a :class:`Robot`; by default the task's robot.
        policy: A :class:`Policy`, a function ``obs -> actions``, or a registered name (:func:`policy_names`).
        out: Output directory.
        scene: A name, a file, a :class:`SceneFileCfg`, or a function that returns a :class:`SceneCfg`; by default the task's
            scene.

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
        action_noise: Add noise to the commands of the arm.
        perturb: Fraction of episodes that are disturbed on purpose: the object is pushed, or slips from the gripper.
        instructions: Instruction of each episode. ``varied``: paraphrases that describe the objects by what
            distinguishes them in that episode; ``canonical``: one sentence per task and object.
        terminate_upon_success: End an episode at its first success.
        max_penetration: Depth of a contact. After an observation with a deeper one, the episode is not a success; 0:
            any depth. By default 4 mm in built-in tasks, and any depth in user-defined ones. Pairs of geoms that are
            deeper at the start do not count. [m]
        episodes: Number of episodes to keep.
        resume: Continue an interrupted recording; all settings that affect the data must be unchanged.
        append: Add new episodes to a completed recording; all settings that affect the data must be unchanged.
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
        max_attempts: Maximum number of episodes to attempt; 0: six times the number to keep.
        num_attempts: Play exactly this number of attempts instead of ending at a number of kept episodes; 0: do not.
        first_attempt: Number of the first attempt.
        attempts: Numbers of the attempts to play, in ascending order, instead of ``first_attempt`` and
            ``num_attempts``.
        shard: ``k/n``, k from 0: play only part k of n of the attempts, in the directory ``shard_k`` of the output
            directory; requires ``num_attempts``, the number of attempts of all shards.
        keep_failures: Keep failed episodes too.
        replay: Store what replay needs: the model, and the simulation's state and controls of every step.
        videos: Store the images of the cameras as videos. Without them, ``mjsense render`` makes the videos of chosen
            episodes afterwards.
        Others:
        sensors: Additional sensors: user-defined ones with an observation_space or is_dict, ones of the core suite, or ones
            written for MolmoSpaces. They are recorded with the suite. If a sensor fails in a world, that world's episode is
            rejected (see ``failures``); if it fails in every world from the first observation on, the recording ends with its
            error.
        format: ``lerobot``, or another of :data:`mjsense.exporting.FORMATS` that is written while recording: write the recording
            as a LeRobot v3.0 data set, as :func:`mjsense.exporting.export_lerobot` does. The recording itself is made in
            ``OUT.recording`` and converted meanwhile.
        map: With ``format="lerobot"``: features and cameras, as in :func:`mjsense.exporting.export_lerobot`.
        trim_idle: With ``format="lerobot"``: leave out the steps in which nothing moves; by default in episodes whose task places
            an object.
        keep_recording: With ``format="lerobot"``: keep ``OUT.recording``, which replay and rendering need. By default it is
            removed when the data set is complete.
        ray: ``local``, ``auto`` or the address of a Ray cluster: record on it, as :func:`mjsense.cluster.record_on_ray` does,
            which has more options. ``out`` may then be an address such as ``s3://bucket/pick``.
        progress: True: shows the progress on stderr. A function: called with the progress about ten times per second. By default
            True where stderr is a terminal or a notebook.
    """
    options = dict(locals())
    for name in ("sensors", "progress", "format", "map", "trim_idle", "keep_recording", "ray"):
        del options[name]
    if ray is not None:
        given = {**options, "map": map, "trim_idle": trim_idle is not None, "keep_recording": keep_recording}
        if refused := [
            name
            for name in (
                "shard",
                "append",
                "overwrite",
                "first_attempt",
                "num_attempts",
                "map",
                "trim_idle",
                "keep_recording",
            )
            if given[name]
        ]:
            raise ValueError(f"record: {refused[0]} cannot be combined with ray")
        return provided("record_on_ray")({**options, "format": format, "sensors": sensors}, ray, progress)
    if format == "mjsense":
        if map is not None or trim_idle is not None or keep_recording:
            raise ValueError("record: map, trim_idle and keep_recording are options of format='lerobot'")
        return record_here(options, sensors, progress)
    if shard or append or overwrite:
        raise ValueError(f"record: shard, append and overwrite cannot be combined with format={format!r}")
    from mjsense.exporting.record_lerobot import converted

    with converted(
        out, format=format, resume=resume, map=map, trim_idle=trim_idle, keep_recording=keep_recording, quiet=progress is False
    ) as folder:
        summary = record_here({**options, "out": folder}, sensors, progress)
    return replace(summary, path=Path(out))
