# SPDX-License-Identifier: Apache-2.0
"""A policy whose commands come from a person, and the function that records with it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mjsense.core.arguments import Seed, checked
from mjsense.core.declared_fields import given_options
from mjsense.core.old_names import old_argument
from mjsense.tasks.parts import Robots, Scenes, Tasks
from mjsense.tasks.policy import Policy
from mjsense.tasks.recording import RecordSummary, record
from mjsense.tasks.teleoperation.devices import Device, device_of
from mjsense.tasks.teleoperation.page import DrivePage
from mjsense.tasks.teleoperation.pose import Pose

_POLL = 0.005  # s between two looks for events while the worlds wait


class Teleoperation(Policy):
    """Drives one arm and its gripper as a person wants, in real time. The arm has the controller ``ee_pose``; other move groups
    hold.

    An episode ends when the task ends it, or when the person does.
    """

    name = "teleoperation"
    observation: Sequence[str] | None = ("actions/ee_pose", "actions/joint_pos", "robot_base_pose")

    def __init__(
        self,
        title: str,
        *,
        arm: str = "arm",
        gripper: str = "gripper",
        device: str = "keyboard",
        host: str = "127.0.0.1",
        port: int = 8080,
        open_browser: bool = True,
    ) -> None:
        """
        Args:
            title: Title of the page.
            arm: Move group that is driven.
            gripper: Move group that is opened and closed.
            device: ``keyboard``: the keys and the handle of the page; ``spacemouse``: also a SpaceMouse.
            host: Address that the page's server is bound to.
            port: Port of the server; if it is taken, the next free one.
            open_browser: Open the page in the default browser.
        """
        self._title, self._arm, self._gripper = title, arm, gripper
        self._device: Device | None = device_of(device)
        self._place = host, port
        self._open_browser = open_browser
        self._page: DrivePage | None = None
        self._new = True
        self._due = 0.0
        self._open = self._closed = np.zeros(1)

    def fingerprint(self) -> str:
        """A resumed recording continues with any device and page."""
        return f"{self._arm} {self._gripper}"

    def initialize(self) -> None:
        for name in (self._arm, self._gripper):
            if name not in self.action_groups:
                raise ValueError(
                    f"teleoperation: the robot has no move group '{name}'; there are {', '.join(self.action_groups)}"
                )
        columns = self.action_groups[self._arm]
        if columns.stop - columns.start != 7:
            raise ValueError(
                f"teleoperation: the controller of move group '{self._arm}' must be ee_pose (arm_controller='ee_pose')"
            )
        if self.num_worlds != 1:
            raise ValueError(f"teleoperation drives 1 world, not {self.num_worlds}")
        self._page = DrivePage(self.sim, self._title, *self._place)
        print(f"Drive the robot at {self._page.url} (Ctrl-C ends the recording)", flush=True)
        self._page.open(self._open_browser)

    def reset(self, ids: np.ndarray) -> None:
        self._new = True

    def act(self, obs: dict[str, Any]) -> dict[str, Any]:
        page = self._page
        assert page is not None
        if self._new:
            self._new = False
            row = np.asarray(obs["actions/ee_pose"][self._arm])[0]
            page.begin_episode(Pose.of_row(obs["robot_base_pose"][0]), Pose.of_row(row), self.instructions[0])
            # Grippers start open: the closed command is the bound that is farther away.
            low, high = (bounds[self.action_groups[self._gripper]] for bounds in (self.action_low, self.action_high))
            self._open = np.array(obs["actions/joint_pos"][self._gripper][0], np.float64)
            self._closed = np.where(self._open - low > high - self._open, low, high)
            self._due = time.perf_counter()
        page.base = Pose.of_row(obs["robot_base_pose"][0])
        page.update()
        while page.paused and not page.finished:
            time.sleep(_POLL)
            page._handle_events()
            self._due = time.perf_counter()
        time.sleep(max(0.0, self._due - time.perf_counter()))
        self._due = max(self._due, time.perf_counter() - self.sim.step_dt) + self.sim.step_dt
        if self._device is not None:
            motion = self._device.read(self.sim.step_dt)
            page.move(motion.translation, motion.rotation)
            if motion.toggle_gripper:
                page.toggle_gripper()
        page._handle_events()
        grip = self._closed if page.gripper_closed else self._open
        return {
            self._arm: self._possible(self._arm, page.target.row),
            self._gripper: self._possible(self._gripper, grip),
            "done": np.array([page.finished]),
        }

    def _possible(self, group: str, command: np.ndarray) -> np.ndarray:
        """Commands [1, n] within the bounds of the group's controller."""
        if not np.isfinite(command).all():
            raise ValueError(f"teleoperation: a command of move group '{group}' is not finite: {command}")
        columns = self.action_groups[group]
        return np.clip(command, self.action_low[columns], self.action_high[columns])[None]

    def close(self) -> None:
        """Stops the page's server."""
        if self._page is not None:
            self._page.close()
            self._page = None


@old_argument("worlds", "num_worlds")
@checked
def play(
    task: Tasks = "pick",
    robot: Robots | None = None,
    *,
    out: str | Path = "demonstrations",
    scene: Scenes = "",
    device: str = "keyboard",
    arm: str = "arm",
    gripper: str = "gripper",
    # options of a recording
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
    # end of options
    seed: Seed = 0,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = True,
    **options: Any,
) -> RecordSummary:
    """Records demonstrations by a person who drives the robot in the browser, as any policy's episodes. The page shows the scene,
    the images of the cameras and a handle at the tool, which is dragged or moved by keys. An episode ends when the task succeeds.

    Args:
        task, robot, scene: As in :func:`record`.
        out: Output directory.
        device: ``keyboard`` or ``spacemouse``.
        arm: Move group that is driven.
        gripper: Move group that is opened and closed.

        Options:
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
        Others:
        seed: Random seed of the starts.
        host: Address that the page's server is bound to; the default is reachable from this computer only. The page opens with
            the printed address, which contains a token.
        port: Port of the server; if it is taken, the next free one; 0: any free one.
        open_browser: Open the page in the default browser.
        options: Further options of :func:`record`, such as ``append=True``.

    Returns:
        The summary of :func:`record`.

    Raises:
        ValueError: The robot has no such move groups, or the arm has no controller ``ee_pose``.
        ModuleNotFoundError: viser, or the package of the device, is not installed.
    """
    arguments = dict(locals())
    title = task if isinstance(task, str) else getattr(task, "__name__", type(task).__name__)
    policy = Teleoperation(title, arm=arm, gripper=gripper, device=device, host=host, port=port, open_browser=open_browser)
    recorded = {
        "num_worlds": 1,
        "arm_controller": "ee_pose",
        "terminate_upon_success": True,
        "action_noise": False,
        "horizon": 6000,
        "max_attempts": 100 * episodes,
        **given_options("FilesCfg", arguments),
        **given_options("ImageCfg", arguments),
        **options,
    }
    try:
        return record(task, robot, policy, out=out, scene=scene, seed=seed, **recorded)
    finally:
        policy.close()
