# SPDX-License-Identifier: Apache-2.0
"""Programs that use molmo-spaces, with images of mjsense.

    import mjsense.compat.molmospaces

    mjsense.compat.molmospaces.use()

From then on, each renderer that molmo-spaces makes draws with mjsense, on the CPU and without OpenGL: ``MjOpenGLRenderer``,
``MjFilamentRenderer``, and everything that uses them (environments, camera sensors, maps of scenes).
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mjsense import _core
from mjsense.compat._opengl import Look
from mjsense.sim.renderer import Renderer, camera_of_name

if TYPE_CHECKING:
    from collections.abc import Iterator

_TESTED = ("0.2.9",)
"""Versions of molmo-spaces that this is tested with."""
_SHADINGS = ("classic", "pbr")

_own: dict[tuple[type, str], Any] = {}
"""By class and name: the methods of molmo-spaces, for renderers that do not use mjsense."""
_threads = 0
_look = Look()
_active = False


def use(shading: str = "classic", threads: int = 0, environment: str = "model") -> None:
    """From now on, renderers that molmo-spaces makes draw with mjsense.

    Args:
        shading: ``classic``: the colours of MuJoCo's OpenGL renderer. ``pbr``: physically based colours.
        threads: Threads that draw the cameras of one observation; 0: one per CPU that is available to this process.
        environment: With ``pbr``, the light from the surroundings, as the option of cameras.

    Raises:
        ImportError: If molmo-spaces is missing, or of a version that was not tested.
        ValueError: For an unknown `shading`, or a negative number of threads.
    """
    global _active, _threads, _look
    look = Look(shading, environment).checked("mjsense.compat.molmospaces.use", _SHADINGS)
    if threads < 0:
        raise ValueError(f"mjsense.compat.molmospaces.use: threads must be at least 0, got {threads}")
    try:
        version = importlib.metadata.version("molmo-spaces")
    except importlib.metadata.PackageNotFoundError:
        raise ImportError(
            f"mjsense.compat.molmospaces.use needs the package molmo-spaces: pip install molmo-spaces=={_TESTED[-1]}"
        ) from None
    if version not in _TESTED:
        raise ImportError(
            f"mjsense.compat.molmospaces.use is tested with molmo-spaces {', '.join(_TESTED)}, and {version} is installed"
        )
    _replace_methods()
    _active, _threads, _look = True, threads, look


def stop() -> None:
    """Renderers that are made from now on are molmo-spaces' own again. Those made before stay as they are."""
    global _active
    _active = False


@contextlib.contextmanager
def used(shading: str = "classic", threads: int = 0, environment: str = "model") -> Iterator[None]:
    """``use()`` for a ``with`` block, and ``stop()`` at its end."""
    use(shading, threads, environment)
    try:
        yield
    finally:
        stop()


def _replace_methods() -> None:
    """Replaces methods once. They call molmo-spaces' own for renderers that do not use mjsense."""
    from molmo_spaces.env.abstract_sensors import SensorSuite  # pyright: ignore[reportMissingImports]
    from molmo_spaces.env.env import CPUMujocoEnv  # pyright: ignore[reportMissingImports]
    from molmo_spaces.renderer.filament_rendering import MjFilamentRenderer  # pyright: ignore[reportMissingImports]
    from molmo_spaces.renderer.opengl_rendering import MjOpenGLRenderer  # pyright: ignore[reportMissingImports]

    if _own:
        return
    methods: dict[type, tuple[Any, ...]] = {
        MjOpenGLRenderer: (__init__, update, render, upload_textures, _closing(MjOpenGLRenderer.close)),
        MjFilamentRenderer: (__init__, update, render, upload_textures, _closing(MjFilamentRenderer.close)),
        CPUMujocoEnv: (render_rgb_frame, render_depth_frame),
        SensorSuite: (get_observations,),
    }
    for owner, functions in methods.items():
        for function in functions:
            _own[owner, function.__name__] = getattr(owner, function.__name__)
            setattr(owner, function.__name__, function)


def _own_method(instance: Any, name: str) -> Any:
    """The method that molmo-spaces defines for this object."""
    return next(_own[owner, name] for owner in type(instance).__mro__ if (owner, name) in _own)


# -------------------------------------------------------------------------------------------- methods of the renderers


def __init__(
    self: Any,
    model_bindings: Any = None,
    device_id: int | None = None,
    height: int = 720,
    width: int = 1280,
    max_geom: int = 10000,
    model: Any = None,
    **kwargs: Any,
) -> None:
    if not _active:
        _own_method(self, "__init__")(self, model_bindings, device_id, height, width, max_geom, model, **kwargs)
        return
    import mujoco
    from molmo_spaces.renderer.abstract_renderer import MjAbstractRenderer  # pyright: ignore[reportMissingImports]

    model = model_bindings.model if model is None and model_bindings is not None else model
    if model is None:
        raise ValueError(f"{type(self).__name__}: pass model or model_bindings")
    if model_bindings is not None and model_bindings.model is not model:
        raise ValueError(f"{type(self).__name__}: model and model_bindings.model must be the same model")
    MjAbstractRenderer.__init__(self, model_bindings=model_bindings, device_id=device_id, model=model)
    self._width, self._height = width, height
    self._scene = mujoco.MjvScene(model, max(max_geom, 2))
    self._scene_option = mujoco.MjvOption()
    self._scene_option.sitegroup[:] = 0  # as molmo-spaces does
    self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = True
    self._gl_context = self._mjr_context = None
    self._context_is_cgl = self._depth_rendering = self._segmentation_rendering = self._textures_need_upload = False
    self._mjsense = _look.give(Renderer.of_scene(model, self._scene, height, width))
    self._mjsense_views = [View(self._scene, self._mjsense)]


def update(self: Any, data: Any, camera: Any = -1, scene_option: Any = None) -> None:
    if (renderer := _renderer_of(self)) is not None:
        renderer.check_data(data)
        if isinstance(camera, str):
            camera = camera_of_name(self.model, camera)
    _own_method(self, "update")(self, data, camera, scene_option)


def render(self: Any, *, out: np.ndarray | None = None, width: int | None = None, height: int | None = None) -> np.ndarray:
    renderer = _renderer_of(self)
    if renderer is None:
        return _own_method(self, "render")(self, out=out, width=width, height=height)
    _show_textures(self)
    kind = "depth" if self._depth_rendering else "segmentation" if self._segmentation_rendering else "rgb"
    image = _images(self, self._mjsense_views[0], (kind,), height or self._height, width or self._width)[kind]
    if out is None:
        return image
    if out.shape != image.shape:
        raise ValueError(f"Expected `out.shape == {image.shape}` for {kind} rendering. Got `out.shape={out.shape}` instead.")
    np.copyto(out, image, casting="unsafe")
    return out


def upload_textures(self: Any, *arguments: Any, **kwargs: Any) -> None:
    if _renderer_of(self) is None:
        _own_method(self, "upload_textures")(self, *arguments, **kwargs)
        return
    for view in self._mjsense_views:
        view.renderer.reload()


def _closing(own: Any) -> Any:
    """The method ``close``, which uses no name of this module: it is also called when the interpreter ends and they are gone."""

    def close(self: Any) -> None:
        views = getattr(self, "_mjsense_views", None)
        if views is None:
            own(self)
        else:
            for view in views:
                view.renderer.close()

    return close


class View(NamedTuple):
    """A scene and the renderer that draws it. The first view of a renderer has the renderer's own scene."""

    scene: Any
    renderer: Renderer


def _renderer_of(renderer: Any) -> Renderer | None:
    """None if it does not use mjsense."""
    return getattr(renderer, "_mjsense", None)


def _show_textures(renderer: Any) -> None:
    """Reads the model's textures again if molmo-spaces has changed them."""
    if renderer._textures_need_upload:
        renderer.upload_textures()
        renderer._textures_need_upload = False


def _images(renderer: Any, view: View, kinds: tuple[str, ...], height: int, width: int) -> dict[str, np.ndarray]:
    """Images of the scene of a view, as molmo-spaces' renderer returns them."""
    import mujoco

    view.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = True  # as molmo-spaces does
    images = view.renderer.render_images(kinds, height=height, width=width)
    if "segmentation" in images:
        images["segmentation"] = _with_bodies(renderer.model, images["segmentation"])
    return images


def _with_bodies(model: Any, found: np.ndarray) -> np.ndarray:
    """int32 [H, W, 3], object id, type and id of the body, -1 for objects that belong to no body, of [H, W, 2]."""
    image = np.empty((*found.shape[:2], 3), np.int32)
    _core.add_bodies(found, model.geom_bodyid, model.site_bodyid, image)
    return image


# ---------------------------------------------------------------------------------- all cameras of an observation at once


def render_rgb_frame(self: Any, camera_name: str) -> np.ndarray:
    frame = _take(self, camera_name, "rgb")
    return _own_method(self, "render_rgb_frame")(self, camera_name) if frame is None else frame


def render_depth_frame(self: Any, camera_name: str) -> np.ndarray:
    frame = _take(self, camera_name, "depth")
    return _own_method(self, "render_depth_frame")(self, camera_name) if frame is None else frame


def get_observations(self: Any, env: Any, task: Any, **kwargs: Any) -> dict[str, Any]:
    wanted = _cameras_of(self, env)
    if sum(map(len, wanted.values())) < 2:
        return _own_method(self, "get_observations")(self, env, task, **kwargs)
    env._mjsense_frames = Frames(env, wanted)
    try:
        return _own_method(self, "get_observations")(self, env, task, **kwargs)
    finally:
        del env._mjsense_frames


def _cameras_of(suite: Any, env: Any) -> dict[str, list[str]]:
    """Kinds of images by camera, in the order of the suite, that molmo-spaces' own sensors read from this environment."""
    from molmo_spaces.env.env import CPUMujocoEnv  # pyright: ignore[reportMissingImports]
    from molmo_spaces.env.sensors_cameras import CameraSensor, DepthSensor  # pyright: ignore[reportMissingImports]

    if not isinstance(env, CPUMujocoEnv) or type(env)._render_frame is not CPUMujocoEnv._render_frame:
        return {}
    if _renderer_of(env._renderer) is None:
        return {}
    wanted: dict[str, list[str]] = {}
    for sensor in suite.sensors.values():
        for kind, owner in (("rgb", CameraSensor), ("depth", DepthSensor)):
            own = getattr(type(sensor), "get_observation", None) is owner.get_observation
            if own and sensor.camera_name in env.camera_manager.registry:
                kinds = wanted.setdefault(sensor.camera_name, [])
                if kind not in kinds:
                    kinds.append(kind)
    return wanted


def _take(env: Any, camera_name: str, kind: str) -> np.ndarray | None:
    frames: Frames | None = getattr(env, "_mjsense_frames", None)
    return None if frames is None else frames.take(env, camera_name, kind)


class Frames:
    """Images of several cameras of one state, which are drawn together. Each equals the one that molmo-spaces' own calls would
    give."""

    def __init__(self, env: Any, wanted: dict[str, list[str]]) -> None:
        self._state = _state_of(env)
        self._poses = {name: _pose_of(env, name) for name in wanted}
        self._images: dict[tuple[str, str], np.ndarray] = {}
        cameras = list(wanted.items())
        threads = min(_threads or len(os.sched_getaffinity(0)), len(cameras))
        views = _views(env._renderer, threads)
        _show_textures(env._renderer)
        before = views[0].scene
        with ThreadPoolExecutor(threads) as pool:
            for first in range(0, len(cameras), threads):
                running = []
                for view, (name, kinds) in zip(views, cameras[first : first + threads], strict=False):
                    _aim(env, view, name, before)
                    before = view.scene
                    task = pool.submit(_images, env._renderer, view, tuple(kinds), env._renderer.height, env._renderer.width)
                    running.append((name, task))
                for name, task in running:
                    self._images |= {(name, kind): image for kind, image in task.result().items()}
        _copy_cameras(before, views[0].scene)

    def take(self, env: Any, camera_name: str, kind: str) -> np.ndarray | None:
        """The image, once; None if it was not drawn, or the camera or the bodies have moved since."""
        image = self._images.pop((camera_name, kind), None)
        if image is None or _pose_of(env, camera_name) != self._poses[camera_name]:
            return None
        return image if _state_of(env) == self._state else None


def _views(renderer: Any, count: int) -> list[View]:
    """This many views of a renderer, with the flags of its scene."""
    import mujoco

    views = renderer._mjsense_views
    while len(views) < count:
        scene = mujoco.MjvScene(renderer.model, renderer.scene.maxgeom)
        look = Look(renderer._mjsense.shading, renderer._mjsense.environment)
        made = look.give(Renderer.of_scene(renderer.model, scene, renderer.height, renderer.width))
        views.append(View(scene, made))
    for view in views[1:]:
        view.scene.flags[:] = renderer.scene.flags
    return views[:count]


def _aim(env: Any, view: View, camera_name: str, before: Any) -> None:
    """Updates the scene of a view as ``CPUMujocoEnv._render_frame`` does.

    MuJoCo puts the headlight and the centres of planes where the scene's camera was before; `before` is the scene of that image.
    """
    import mujoco

    renderer, model, camera = env._renderer, env.mj_model, env.camera_manager.registry[camera_name]
    if view.scene is not before:
        _copy_cameras(before, view.scene)
    renderer._mjsense.check_data(env.current_data)
    fovy, model.vis.global_.fovy = model.vis.global_.fovy, camera.fov
    try:
        free = mujoco.MjvCamera()
        free.type = mujoco.mjtCamera.mjCAMERA_FREE
        mujoco.mjv_updateScene(
            model, env.current_data, renderer._scene_option, None, free, mujoco.mjtCatBit.mjCAT_ALL.value, view.scene
        )
    finally:
        model.vis.global_.fovy = fovy
    for eye in view.scene.camera:
        eye.pos, eye.forward, eye.up = camera.pos, camera.forward, camera.up


def _copy_cameras(source: Any, target: Any) -> None:
    for a, b in zip(source.camera, target.camera, strict=True):
        b.pos, b.forward, b.up = a.pos, a.forward, a.up


def _pose_of(env: Any, camera_name: str) -> tuple[Any, ...]:
    camera = env.camera_manager.registry[camera_name]
    return (*(np.asarray(value, np.float32).tobytes() for value in (camera.pos, camera.forward, camera.up)), camera.fov)


def _state_of(env: Any) -> tuple[Any, ...]:
    data = env.current_data
    return id(env._renderer), id(data), data.xpos.tobytes(), data.xquat.tobytes()
