# SPDX-License-Identifier: Apache-2.0
"""Images of dm_control without OpenGL.

    mjsense.compat.dm_control.use()
    env = suite.load("cheetah", "run")
    pixels = env.physics.render(84, 84, camera_id="side")

``use`` also serves packages that build on dm_control, such as gym-aloha.
"""

from __future__ import annotations

import contextlib
import weakref
from typing import TYPE_CHECKING, Any

import mujoco
from dm_control.mujoco import engine, wrapper  # pyright: ignore[reportMissingImports]

from mjsense.compat._opengl import Look
from mjsense.sim.renderer import Renderer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_opengl = {
    "copy": engine.Physics.copy,
    "make_contexts": engine.Physics._make_rendering_contexts,
    "physics_render": engine.Physics.render,
    "camera_render": engine.Camera.render,
}
"""dm_control's own functions, for physics that do not use mjsense."""


class Context:
    """Stands for dm_control's OpenGL context and its ``MjrContext``; has the renderer and the scene of ``Physics.render``."""

    ptr = None

    def __init__(self, physics: Any) -> None:
        self.scene = wrapper.MjvScene(physics.model)
        self.flags = self.scene.flags.copy()
        self.renderers: weakref.WeakSet[Renderer] = weakref.WeakSet()
        self.renderer = self.renderer_of(physics, self.scene)
        self.cameras: dict[tuple[Any, ...], Any] = {}

    def renderer_of(self, physics: Any, scene: Any) -> Renderer:
        renderer = physics._mjsense_look.give(Renderer.of_scene(physics.model.ptr, scene, 1, 1))
        self.renderers.add(renderer)
        return renderer

    def camera(self, physics: Any, height: int, width: int, camera_id: int | str) -> Any:
        """The camera of ``Physics.render``. It is kept: a new one makes a new scene, and that takes 1 ms."""
        key = (height, width, camera_id)
        if key not in self.cameras:
            camera = self.cameras[key] = engine.Camera(physics, height, width, camera_id)
            camera._scene, camera._renderer = self.scene, self.renderer
        camera = self.cameras[key]
        self.scene.flags[:] = self.flags
        if camera._render_camera.fixedcamid == -1:
            mujoco.mjv_defaultFreeCamera(physics.model.ptr, camera._render_camera.ptr)
        return camera

    @contextlib.contextmanager
    def make_current(self) -> Iterator[Context]:
        yield self

    def call(self, function: Callable[..., Any], *_: Any) -> None:
        """Environments call ``mjr_upload*`` after changes of height fields and textures."""
        name = function.__name__
        if name.startswith("mjr_upload"):
            for renderer in self.renderers:
                renderer.reload()
        elif name != "mjr_setBuffer":
            raise ValueError(f"mjsense.compat.dm_control: {name} needs OpenGL, which this environment does not use after use()")

    def free(self) -> None:
        self.cameras.clear()


def _make_contexts(physics: Any) -> None:
    if getattr(physics, "_uses_mjsense", False):
        context = Context(physics)
        physics._contexts = engine.Contexts(gl=context, mujoco=context)
    else:
        _opengl["make_contexts"](physics)


def _copy(physics: Any, share_model: bool = False) -> Any:
    made = _opengl["copy"](physics, share_model)
    made._uses_mjsense = getattr(physics, "_uses_mjsense", False)
    made._mjsense_look = getattr(physics, "_mjsense_look", Look())
    return made


def _follow_recompilation(env: Any, look: Look) -> None:
    """Environments of dm_control's composer make a new physics when their model changes, usually for each episode."""
    recompile = getattr(env, "_recompile_physics", None)
    owner = getattr(recompile, "__self__", None)  # `env`, or the one in its wrapper; None if this was done before
    if recompile is None or owner is None:
        return

    def recompile_and_use() -> None:
        recompile()
        owner._physics._uses_mjsense, owner._physics._mjsense_look = True, look

    owner._recompile_physics = recompile_and_use


def _physics_render(
    physics: Any,
    height: int = 240,
    width: int = 320,
    camera_id: int | str = -1,
    overlays: Any = (),
    depth: bool = False,
    segmentation: bool = False,
    scene_option: Any = None,
    render_flag_overrides: Any = None,
    scene_callback: Any = None,
) -> Any:
    arguments = (overlays, depth, segmentation, scene_option, render_flag_overrides)
    context = physics.contexts.gl
    if not isinstance(context, Context):
        return _opengl["physics_render"](physics, height, width, camera_id, *arguments, scene_callback)
    camera = context.camera(physics, height, width, camera_id)
    camera._scene_callback = scene_callback
    return camera.render(*arguments)


def _camera_render(
    camera: Any,
    overlays: Any = (),
    depth: bool = False,
    segmentation: bool = False,
    scene_option: Any = None,
    render_flag_overrides: Any = None,
) -> Any:
    physics = camera._physics
    context = physics.contexts.gl
    if not isinstance(context, Context):
        return _opengl["camera_render"](camera, overlays, depth, segmentation, scene_option, render_flag_overrides)
    if overlays:
        raise ValueError("mjsense.compat.dm_control: overlay texts are not drawn; remove the argument overlays")
    if depth and segmentation:
        raise ValueError("mjsense.compat.dm_control: depth and segmentation cannot both be True")
    if render_flag_overrides and (depth or segmentation):
        raise ValueError("mjsense.compat.dm_control: render_flag_overrides cannot be used with depth or segmentation")
    model, scene = physics.model.ptr, camera._scene
    renderer = getattr(camera, "_renderer", None)
    if renderer is None or renderer.model is not model:
        renderer = camera._renderer = context.renderer_of(physics, scene)
    mujoco.mjv_updateCamera(model, physics.data.ptr, camera._render_camera.ptr, scene)
    camera.update(scene_option)
    if camera._scene_callback:
        camera._scene_callback(physics, scene)
    kind = "depth" if depth else "segmentation" if segmentation else "rgb"
    with scene.override_flags(render_flag_overrides):
        return renderer.render_images((kind,), height=camera.height, width=camera.width)[kind]


def use(env: Any = None, shading: str = "classic", environment: str = "model") -> Any:
    """Makes dm_control's images come from mjsense: ``Physics.render``, ``Camera`` and the wrappers that call them.

    Overlay texts are an error; `render_flag_overrides` and `scene_option` have the same limits as in ``mjsense.Renderer``.

    Args:
        env: the environment, or the ``Physics``; None for all of this process that have not rendered yet. Copies that
            ``copy.deepcopy`` or pickle make use mjsense only with None.
        shading: ``classic``: the colours of MuJoCo's OpenGL renderer. ``pbr``: physically based colours. ``path``: path
            tracing.
        environment: With ``pbr`` and ``path``, the light from the surroundings, as the option of cameras.

    Returns:
        `env`.

    Raises:
        TypeError: If `env` has no physics of dm_control.
        ValueError: For an unknown `shading`.
    """
    look = Look(shading, environment).checked("mjsense.compat.dm_control.use")
    physics = engine.Physics if env is None else getattr(env, "physics", env)
    if env is not None and not isinstance(physics, engine.Physics):
        raise TypeError(
            f"mjsense.compat.dm_control.use: {env} has no physics of type dm_control.mujoco.Physics; call use() "
            "before environments are made"
        )
    engine.Physics.copy = _copy
    engine.Physics._make_rendering_contexts = _make_contexts
    engine.Physics.render = _physics_render
    engine.Camera.render = _camera_render
    physics._uses_mjsense, physics._mjsense_look = True, look
    _follow_recompilation(env, look)
    if env is not None and physics._contexts:
        physics._free_rendering_contexts()
    return env
