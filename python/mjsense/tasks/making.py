# SPDX-License-Identifier: Apache-2.0
"""Makes the environments of a task: the options, and which of them each backend has."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from typing import Any, Literal

from gymnasium.vector import AutoresetMode

from mjsense.core.arguments import Seed, check_options, checked
from mjsense.core.later_rooms import provided
from mjsense.tasks.env import TaskEnv
from mjsense.tasks.parts import Policies, Robots, Scenes, Tasks, parts_of
from mjsense.tasks.vector import TaskVectorEnv, checked_episodes

_WITH_WARP = set(
    """
    task num_envs seed horizon policy_dt_ms terminate_upon_success observations sensors use_sensors instructions shadows
    meshes autoreset_mode action_space episodes backend device nconmax njmax
    """.split()
)
"""Arguments of make_vec() that have an effect, or no meaning, with backend="warp"."""


def _check_backend(arguments: dict[str, Any]) -> None:
    """Raises ValueError for arguments of the other backend."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(make_vec).parameters.items()}
    given = [name for name, value in arguments.items() if value is not defaults[name] and value != defaults[name]]
    if arguments["backend"] == "cpu":
        wrong = [name for name in given if name in ("device", "nconmax", "njmax")]
    else:
        wrong = [name for name in given if name not in _WITH_WARP and not (name == "cameras" and not arguments["cameras"])]
    if wrong:
        other = "warp" if arguments["backend"] == "cpu" else "cpu"
        raise ValueError(f"make_vec(): {', '.join(wrong)} {'is' if len(wrong) == 1 else 'are'} for backend='{other}'")


@checked
def make_vec(
    task: Tasks = "pick",
    robot: Robots | None = None,
    *,
    scene: Scenes = "",
    policy: Policies = None,
    observations: Sequence[str] | None = None,
    sensors: Iterable[Any] = (),
    # options of a recording
    arm_controller: str = "",
    split: Literal["", "train", "test"] = "",
    backdrop: str = "",
    num_envs: int = 1,
    threads: int = 0,
    seed: Seed | None = None,
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
    action_noise: bool = False,
    perturb: float = 0.0,
    instructions: Literal["varied", "canonical"] = "varied",
    terminate_upon_success: bool = False,
    max_penetration: float | None = None,
    # end of options
    episodes: Sequence[int] | None = None,
    use_sensors: bool = True,
    autoreset_mode: str | AutoresetMode = "next_step",
    render_mode: str | None = None,
    action_space: Literal["commands", "normalised"] = "commands",
    backend: Literal["cpu", "warp"] = "cpu",
    device: str | None = None,
    nconmax: int | None = None,
    njmax: int | None = None,
) -> TaskVectorEnv:
    """Creates a gymnasium vector environment of a task.

    Args:
        task: A :class:`Task`, its class, or a registered name (:func:`task_names`).
        robot: A registered name (:func:`robot_names`), the path of a ``.toml``, or a :class:`Robot`; by default the task's robot.
        scene: A name, a file, a :class:`SceneFileCfg`, or a function that returns a :class:`SceneCfg`; by default the task's
            scene.
        policy: Policy of :meth:`TaskVectorEnv.expert_action`: a :class:`Policy`, a function or a registered name.
        observations: Names of the sensors ("qpos") or streams ("qpos/arm") to observe; by default all numeric ones.
        sensors: Additional sensors, as in :func:`record`. They are observed with the suite; dict sensors as JSON text (uint8). If
            a sensor fails in a world, that world's episode is ``truncated`` and ``info["fault"]`` contains the reason.

        Options:
        arm_controller: Controller of the robot's arms, which decides what an action is: its kind, for example
            ``ee_delta_pose``, or a TOML table with its fields; by default that of the robot's file.
        split: Part of the scene: ``train`` or ``test``, which have no kind of object in common; the same as ``@train``
            or ``@test`` after the scene's name.
        backdrop: Surroundings of the scene that are only seen, an MJCF, .glb, .gltf or .obj file: nothing touches its
            geoms.
        num_envs: Number of worlds that run in parallel.
        threads: Number of simulation threads; 0: one per available CPU.
        seed: Random seed; the same seed gives the same episodes. None: a random seed, so that every environment has
            other episodes.
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
        Others:
        episodes: Numbers of the episodes to play, each once, instead of all from 0 on; see :class:`TaskVectorEnv`. They are the
            numbers of ``record(first_attempt=...)``: the start depends on the seed and the number only.
        use_sensors: Use the sensors of the task, the robot and the policy. False: only those in ``sensors``.
        autoreset_mode: next_step, same_step or disabled.
        render_mode: None or rgb_array.
        action_space: ``commands``: actions are the commands of the robot's controllers, in their units. ``normalised``: actions
            from -1 to 1, mapped linearly to the range of each command and clipped; an error if a command has no range.
        backend: ``"cpu"``, or ``"warp"``: worlds on mujoco_warp, for tasks written in Python whose robot is part of the scene.
            Observations, rewards and the ends of episodes are then torch tensors on the device.
        device: With warp: ``"cpu"``, ``"cuda:0"`` ...; by default the first CUDA device, or the CPU without one.
        nconmax: With warp: contacts for which each world has memory, on average over the worlds.
        njmax: With warp: constraint rows for which each world has memory.
    """
    sensors = list(sensors)
    options = dict(locals())
    if num_envs < 1:
        raise ValueError(f"make_vec(): num_envs is {num_envs}: must be at least 1")
    arguments = dict(options)
    _check_backend(options)
    numbers = None if episodes is None else checked_episodes("make_vec()", episodes)
    for name in ("episodes", "observations", "sensors", "autoreset_mode", "render_mode", "action_space", "backend"):
        del options[name]
    if backend == "cpu":
        for name in ("device", "nconmax", "njmax"):
            del options[name]
    options["num_worlds"] = options.pop("num_envs")
    objects = parts_of(options, sensors)
    if backend == "warp":
        if objects[0] is None:
            raise ValueError(
                f"make_vec(): task '{options['task']}' is not available with backend='warp', which plays tasks written in Python"
            )
        made = provided("warp_environment")(options, objects, observations, render_mode, autoreset_mode, action_space, numbers)
    else:
        made = TaskVectorEnv(options, objects, observations, render_mode, autoreset_mode, action_space, numbers)
    made._made_by = make_vec, arguments
    return made


@checked
def make(task: Tasks = "pick", robot: Robots | None = None, **options: Any) -> TaskEnv:
    """Creates a gymnasium environment of a task with one world. The options are those of :func:`make_vec` except ``num_envs`` and
    ``autoreset_mode``: call ``reset()`` after the end of an episode."""
    of_many_worlds = ("num_envs", "autoreset_mode")
    for name in of_many_worlds:
        if name in options:
            raise TypeError(f"make() has no {name}: that is make_vec()'s")
    check_options("make()", options, make_vec, without=of_many_worlds)
    return TaskEnv(make_vec(task, robot, num_envs=1, autoreset_mode="disabled", **options))
