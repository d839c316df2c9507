# SPDX-License-Identifier: Apache-2.0
"""Images of Gymnasium's MuJoCo environments without OpenGL.

    env = mjsense.compat.gymnasium.use(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array"))
    env.reset()
    env.render()

``use`` works for every environment with a ``MujocoRenderer``: Gymnasium's own, gymnasium-robotics, Meta-World. In a vector
environment, call it in the function that makes each environment.
"""

from __future__ import annotations

from typing import Any

import mujoco
from gymnasium.vector import VectorEnv

try:
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer, OffScreenViewer
except ModuleNotFoundError as error:
    message = f"Gymnasium's MuJoCo environments need {error.name}: pip install 'gymnasium[mujoco]' ({error})"
    raise ModuleNotFoundError(message, name=error.name) from error

from mjsense.compat._opengl import Look, depth_buffer
from mjsense.sim.renderer import Renderer, camera_of_name


class Viewer(OffScreenViewer):
    """Gymnasium's offscreen viewer; ``render`` has its arguments and results.

    Depth is 0 at the near plane and 1 at the far plane, as OpenGL stores it, and 1 where nothing is seen. Overlay texts are not
    drawn.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        width: int,
        height: int,
        max_geom: int = 1000,
        visual_options: dict[int, bool] | None = None,
        look: Look | None = None,
    ) -> None:
        # The base class's constructor would make an OpenGL context.
        self.model, self.data = model, data
        self._markers: list[dict[str, Any]] = []
        self._overlays: dict[int, list[str]] = {}
        self.viewport = mujoco.MjrRect(0, 0, width, height)
        self.scn = mujoco.MjvScene(model, max(max_geom, 2))
        self.cam = mujoco.MjvCamera()
        self.vopt = mujoco.MjvOption()
        self.pert = mujoco.MjvPerturb()
        for flag, value in (visual_options or {}).items():
            self.vopt.flags[flag] = value
        self._renderer = (look or Look()).give(Renderer.of_scene(model, self.scn, height, width))
        self._init_camera()

    def make_context_current(self) -> None:
        pass

    def free(self) -> None:
        pass

    def close(self) -> None:
        self._renderer.close()

    def render(self, render_mode: str | None, camera_id: int | None = None, segmentation: bool = False) -> Any:
        if self._overlays:
            raise ValueError("mjsense.compat.gymnasium: overlay texts are not drawn; remove the calls of add_overlay()")
        if camera_id is not None:
            self.cam.type = mujoco.mjtCamera.mjCAMERA_FREE if camera_id == -1 else mujoco.mjtCamera.mjCAMERA_FIXED
            self.cam.fixedcamid = camera_id
        mujoco.mjv_updateCamera(self.model, self.data, self.cam, self.scn)
        mujoco.mjv_updateScene(self.model, self.data, self.vopt, self.pert, self.cam, mujoco.mjtCatBit.mjCAT_ALL, self.scn)
        for marker in self._markers:
            self._add_marker_to_scene(marker)
        self._markers.clear()
        color = "segmentation" if segmentation else "rgb"
        kinds = {"rgb_array": (color,), "depth_array": ("depth",)}.get(str(render_mode), (color, "depth"))
        images = self._renderer.render_images(kinds)
        if segmentation and color in images:
            images[color] = images[color][..., ::-1]  # Gymnasium puts the type first
        if "depth" in images:
            images["depth"] = depth_buffer(images["depth"], self.scn)
        return images[kinds[0]] if len(kinds) == 1 else (images[color], images["depth"])


def _drawn(env: Any) -> Any:
    """The environment that has the ``MujocoRenderer``: `env`, or one that it contains, as gymnasium-robotics' kitchen and mazes
    do."""
    if isinstance(env, VectorEnv):
        raise TypeError(
            f"mjsense.compat.gymnasium.use: {env} is a vector environment; call use in the function that makes each environment"
        )
    inner = getattr(env, "unwrapped", None)
    for each in (inner, *(getattr(inner, name, None) for name in ("robot_env", "point_env", "ant_env"))):
        if isinstance(getattr(each, "mujoco_renderer", None), MujocoRenderer):
            return each
    raise TypeError(
        "mjsense.compat.gymnasium.use: expected an environment with a mujoco_renderer of type "
        f"gymnasium.envs.mujoco.MujocoRenderer, got {env!r:.100}"
    )


def renderer_of(env: Any) -> MujocoRenderer:
    return _drawn(env).mujoco_renderer


def use(env: Any, shading: str = "classic", environment: str = "model") -> Any:
    """Makes the environment's ``MujocoRenderer`` draw with mjsense, for all render modes but ``human``; returns `env`.

    Args:
        env: The environment.
        shading: ``classic``: the colours of MuJoCo's OpenGL renderer. ``pbr``: physically based colours. ``path``: path tracing.
        environment: With ``pbr`` and ``path``, the light from the surroundings, as the option of cameras.

    Raises:
        TypeError: if the environment has no ``MujocoRenderer``.
        ValueError: if its ``camera_name`` does not exist, for which Gymnasium shows the free camera; for an unknown `shading`.
    """
    look = Look(shading, environment).checked("mjsense.compat.gymnasium.use")
    renderer = renderer_of(env)
    name = getattr(_drawn(env), "camera_name", None)
    if name is not None:
        camera_of_name(renderer.model, name)
    if (earlier := renderer._viewers.pop("mjsense", None)) is not None:  # of another call, with other shading
        earlier.close()
    get_viewer = renderer._get_viewer

    def viewer_of(render_mode: str | None) -> Any:
        if render_mode not in ("rgb_array", "depth_array", "rgbd_tuple"):
            return get_viewer(render_mode)
        viewer = renderer._viewers.get("mjsense")
        if viewer is None:
            assert renderer.width is not None and renderer.height is not None
            viewer = Viewer(
                renderer.model, renderer.data, renderer.width, renderer.height, renderer.max_geom, renderer._vopt, look
            )
            renderer.viewer = renderer._viewers["mjsense"] = viewer
            renderer._set_cam_config()
        renderer.viewer = viewer
        return viewer

    renderer._get_viewer = viewer_of
    return env
