# SPDX-License-Identifier: Apache-2.0
"""``mjsense.Renderer``: the interface of ``mujoco.Renderer``, without OpenGL."""

from __future__ import annotations

import os
import warnings
from concurrent.futures import ThreadPoolExecutor, wait
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core.arguments import OutputArray, checked
from mjsense.core.counted import counted
from mjsense.core.errors import nearest
from mjsense.core.one_thread import OneThread, guarded
from mjsense.sim.scene_drawer import SceneDrawer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import mujoco

# fmt: off
_SIZES = (
    "nq", "nv", "nbody", "ngeom", "nsite", "ncam", "nlight", "nmesh", "nskin", "nflex", "nflexvert", "ntendon", "nu", "ntex",
    "nmat",
)
# fmt: on
"""Sizes of the model that must stay the same, and that data must have."""

_OPTIONS = ("point_lights", "shading", "environment", "samples_per_pixel")
_KINDS: dict[str, tuple[type, tuple[int, ...]]] = {
    "rgb": (np.uint8, (3,)),
    "depth": (np.float32, ()),
    "segmentation": (np.int32, (2,)),
}
"""Element type and channels by kind of image."""

_NO_POSES = "`data` has no poses yet, and no geoms are drawn: call mujoco.mj_forward(model, data)"
_NO_CAMERA = (
    "the image is empty, because its camera has no pose: call mujoco.mj_forward(model, data) and update_scene(data) before"
)


def _sizes_of(model: mujoco.MjModel) -> tuple[int, ...]:
    return tuple(getattr(model, name) for name in _SIZES)


def _has_poses(data: mujoco.MjData) -> bool:
    return bool(data.xmat[0].any())  # otherwise MuJoCo has not even computed that of the world


class _Pool:
    """Threads of this process, with a renderer for each."""

    def __init__(self, make: Callable[[], Renderer]) -> None:
        self.process = os.getpid()
        count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.threads = ThreadPoolExecutor(count)
        self.free: SimpleQueue[Renderer] = SimpleQueue()
        self._make = make

    def take(self) -> Renderer:
        try:
            return self.free.get_nowait()
        except Empty:
            return self._make()


def camera_of_name(model: mujoco.MjModel, name: str) -> int:
    """The id of a camera; ValueError with the nearest names if there is none."""
    import mujoco

    kind = mujoco.mjtObj.mjOBJ_CAMERA.value
    id = mujoco.mj_name2id(model, kind, name)
    if id == -1:
        names = [mujoco.mj_id2name(model, kind, i) or f"(camera {i}, unnamed)" for i in range(model.ncam)]
        near = nearest(name, names, cutoff=0.0)
        known = f"Nearest: {', '.join(near)}." if near else "The model has no cameras."
        raise ValueError(f'The camera "{name}" does not exist. {known}')
    return id


@checked
class Renderer:
    """Renders MuJoCo scenes on the CPU, with the interface of ``mujoco.Renderer`` and without OpenGL.

    Works with models and data of the MuJoCo that the environment has installed. MuJoCo itself builds the scene
    (``mujoco.mjv_updateScene``), so that cameras, ``scene_option`` and decoration geoms mean what they mean there; the image is
    ray-cast.

        renderer = mjsense.Renderer(model, height=240, width=320)
        renderer.update_scene(data, camera="front")
        image = renderer.render()  # uint8 [240, 320, 3]

    One thread at a time can use a renderer: a call during that of another thread is an error, and ``close()`` waits for it. Use
    one renderer per thread, or ``render_batch``, which several threads may call at the same time.

    Args:
        model: the ``mujoco.MjModel``.
        height: height of the images in pixels; not limited by ``offheight``.
        width: width of the images in pixels; not limited by ``offwidth``.
        max_geom: maximum number of geoms in the scene, decoration included.
        font_scale: accepted for compatibility; labels are not drawn.

    Raises:
        ValueError: for a height or width below 1.
        TypeError: if `model` is not an ``MjModel``.
    """

    def __init__(
        self, model: mujoco.MjModel, height: int = 240, width: int = 320, max_geom: int = 10000, font_scale: Any = 150
    ) -> None:
        import mujoco

        self._set_up(model, height, width, mujoco.MjvScene(model, max(int(max_geom), 2)))

    @classmethod
    def of_scene(cls, model: mujoco.MjModel, scene: mujoco.MjvScene, height: int, width: int) -> Renderer:
        """A renderer of a scene that the caller updates with ``mujoco.mjv_updateScene``; ``render()`` draws its current contents.

        `scene` must have room for at least two geoms.
        """
        made = cls.__new__(cls)
        made._set_up(model, height, width, scene)
        return made

    def _set_up(self, model: mujoco.MjModel, height: int, width: int, scene: mujoco.MjvScene) -> None:
        import mujoco

        self._guard = OneThread("Renderer: another thread is using it; use one renderer per thread")
        self._batch: _Pool | None = None
        self._batch_guard = OneThread("")
        self._warned: set[str] = set()
        self._mujoco = mujoco
        self._model = model
        self._height, self._width = self._checked_size(height, width)
        self._scene = scene
        self._scene_option = mujoco.MjvOption()
        self._depth = self._segmentation = self._point_lights = False
        self._shading, self._environment, self._samples_per_pixel = "classic", "model", 64
        self._sizes = _sizes_of(model)
        self._drawer: SceneDrawer | None = SceneDrawer(model, scene)

    @staticmethod
    def _checked_size(height: int, width: int) -> tuple[int, int]:
        for name, value in (("height", height), ("width", width)):
            if int(value) < 1:
                raise ValueError(f"Renderer: {name} must be at least 1, got {value}")
        return int(height), int(width)

    @property
    def model(self) -> mujoco.MjModel:
        return self._model

    @property
    def scene(self) -> mujoco.MjvScene:
        """The abstract scene of the last ``update_scene``. Geoms that are added to it, or edited, appear in the image."""
        return self._scene

    def __setattr__(self, name: str, value: Any) -> None:
        """Programs may add attributes, as to ``mujoco.Renderer``, but a misspelt option is an error."""
        if name[0] != "_" and not hasattr(type(self), name) and (near := nearest(name, _OPTIONS)):
            raise AttributeError(f"Renderer has no attribute '{name}'; did you mean '{near[0]}'?")
        object.__setattr__(self, name, value)

    @property
    def point_lights(self) -> bool:
        """Whether lights of type ``point`` shine from their position, as in the cameras of scenes, without attenuation. False,
        the default: as in MuJoCo's OpenGL renderer, which draws point and image lights as lights at the camera before 3.12, and
        not at all from 3.12 on."""
        return self._point_lights

    @point_lights.setter
    def point_lights(self, value: bool) -> None:
        self._point_lights = bool(value)

    @property
    def _look(self) -> tuple[str, str, int]:
        return self._shading, self._environment, self._samples_per_pixel

    def _set_look(self, *look: Any) -> None:
        self._opened().native.set_shading(*look)
        self._shading, self._environment, self._samples_per_pixel = look

    @property
    def shading(self) -> str:
        """``"classic"``, the default: MuJoCo's light model; ``"pbr"``: physically based colours, as those of cameras with
        ``shading="pbr"``; or ``"path"``: the same by path tracing, on all CPUs. Depth and segmentation are the same."""
        return self._shading

    @shading.setter
    def shading(self, value: str) -> None:
        self._set_look(value, self._environment, self._samples_per_pixel)

    @property
    def environment(self) -> str:
        """With ``shading="pbr"`` or ``"path"``: the light from the surroundings, as the option `environment` of cameras;
        ``"model"`` by default."""
        return self._environment

    @environment.setter
    def environment(self, value: str) -> None:
        self._set_look(self._shading, value, self._samples_per_pixel)

    @property
    def samples_per_pixel(self) -> int:
        """Paths per pixel with ``shading="path"``, 64 by default; four times as many halve the noise."""
        return self._samples_per_pixel

    @samples_per_pixel.setter
    def samples_per_pixel(self, value: int) -> None:
        self._set_look(self._shading, self._environment, value)

    @property
    def height(self) -> int:
        return self._height

    @property
    def width(self) -> int:
        return self._width

    @guarded
    def enable_depth_rendering(self) -> None:
        self._segmentation = False
        self._depth = True

    @guarded
    def disable_depth_rendering(self) -> None:
        self._depth = False

    @guarded
    def enable_segmentation_rendering(self) -> None:
        self._segmentation = True
        self._depth = False

    @guarded
    def disable_segmentation_rendering(self) -> None:
        self._segmentation = False

    def _opened(self) -> SceneDrawer:
        if self._drawer is None:
            raise RuntimeError("Renderer: used after close(); make a new one")
        return self._drawer

    def _warn(self, text: str) -> None:
        """Warns once, at the line that calls the public method that calls this."""
        if text not in self._warned:
            self._warned.add(text)
            warnings.warn(f"Renderer: {text}", stacklevel=4)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            gl = (
                "; there is no OpenGL. Call reload() after a change of the model's textures, meshes or height "
                "fields (mjr_uploadTexture ...)"
            )
            raise AttributeError(f"Renderer has no attribute '{name}'{gl if name in ('_mjr_context', '_gl_context') else ''}")

    def _check_sizes(self, model: mujoco.MjModel, what: str) -> None:
        sizes = _sizes_of(model)
        if sizes == self._sizes:
            return
        name, found, expected = next(row for row in zip(_SIZES, sizes, self._sizes) if row[1] != row[2])
        raise ValueError(f"Renderer: {what}: {name} is {found}, but the renderer's model had {expected}")

    def _camera(self, camera: Any) -> mujoco.MjvCamera:
        mujoco, model = self._mujoco, self._model
        if isinstance(camera, mujoco.MjvCamera):
            return camera
        id = camera_of_name(model, camera) if isinstance(camera, str) else int(camera)
        if not -1 <= id < model.ncam:
            raise ValueError(f"The camera id {id} is out of range [-1, {model.ncam}).")
        out = mujoco.MjvCamera()
        out.fixedcamid = id
        if id == -1:
            out.type = mujoco.mjtCamera.mjCAMERA_FREE
            mujoco.mjv_defaultFreeCamera(model, out)
        else:
            out.type = mujoco.mjtCamera.mjCAMERA_FIXED
        return out

    def update_scene(
        self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera = -1, scene_option: mujoco.MjvOption | None = None
    ) -> None:
        """Updates ``scene`` from `data`.

        Args:
            data: data of the renderer's model.
            camera: id or name of a camera of the model, -1 for the default free camera, or an ``MjvCamera`` (free, fixed or
                tracking).
            scene_option: visibility of groups and elements; None for MuJoCo's defaults.

        MuJoCo draws no geoms of a `data` for which ``mj_forward`` was never called; the first such call warns.

        Raises:
            ValueError: if the camera does not exist, or `data` belongs to a model of another size.
            RuntimeError: after ``close()``, or if another thread is using the renderer.
        """
        with self._guard:
            self._update(data, camera, scene_option)
        if not _has_poses(data):
            self._warn(f"{_NO_POSES} before update_scene()")

    def check_data(self, data: mujoco.MjData) -> None:
        """Raises the errors of ``update_scene`` for `data` and the model, for callers that update the scene themselves."""
        drawer = self._opened()
        self._check_sizes(self._model, "the model has changed")
        owner = getattr(data, "model", self._model)
        if owner is not self._model:
            self._check_sizes(owner, "`data` belongs to another model")
        drawer.native.check_indices()

    def _update(self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera, scene_option: mujoco.MjvOption | None) -> None:
        self.check_data(data)
        mujoco, view = self._mujoco, self._camera(camera)
        self._opened().fixed_camera = view.fixedcamid if view.type == mujoco.mjtCamera.mjCAMERA_FIXED else -1
        # MuJoCo centres infinite planes at the camera that the scene had before; without this call an image would depend on it.
        mujoco.mjv_updateCamera(self._model, data, view, self._scene)
        if any(camera.frustum_near < 1e-15 for camera in self._scene.camera):  # for which mjv_updateScene ends the process
            raise ValueError(
                "Renderer: the near plane of the scene's camera is at 0: set model.vis.map.znear, or "
                "renderer.scene.camera for mjCAMERA_USER"
            )
        mujoco.mjv_updateScene(
            self._model, data, scene_option or self._scene_option, None, view, mujoco.mjtCatBit.mjCAT_ALL.value, self._scene
        )

    def render(self, *, out: OutputArray | None = None) -> np.ndarray:
        """Renders the scene.

        Args:
            out: array for the image, of the shape below; its type is cast to if necessary.

        Returns:
            A new array, or `out`: rgb uint8 [H, W, 3]; with depth rendering float32 [H, W], distance to the camera plane in m,
            the far plane's where nothing is seen; with segmentation rendering int32 [H, W, 2], object id and type, (-1, -1) where
            nothing is seen.

        Before the first ``update_scene`` the image is black, as MuJoCo's, and the first call warns.

        Raises:
            RuntimeError: after ``close()``, or if another thread is using the renderer.
            ValueError: if the shape of `out` is wrong, if a pose is not finite, or if the scene contains something that cannot be
                drawn.
        """
        with self._guard:
            drawer = self._opened()
            kind = "depth" if self._depth else "segmentation" if self._segmentation else "rgb"
            dtype, channels = _KINDS[kind]
            shape = (self._height, self._width, *channels)
            if out is not None and out.shape != shape:
                raise ValueError(f"Expected `out.shape == {shape}` for {kind} rendering. Got `out.shape={out.shape}` instead.")
            direct = out is not None and out.dtype == dtype and out.flags.c_contiguous and out.flags.writeable
            image = out if out is not None and direct else np.empty(shape, dtype)
            drawn = drawer.draw(**{kind: image}, point_lights=self._point_lights)
            if out is not None and not direct:
                np.copyto(out, image, casting="unsafe")
        if not drawn:
            self._warn(_NO_CAMERA)
        return image if out is None else out

    def render_images(
        self, kinds: Sequence[str] = ("rgb", "depth", "segmentation"), *, height: int | None = None, width: int | None = None
    ) -> dict[str, np.ndarray]:
        """Renders several images of the scene at once: ``rgb``, ``depth`` and ``segmentation``, with the shapes and types of
        ``render()``.

        Args:
            kinds: the images.
            height: height of these images in pixels; None for the renderer's.
            width: width of these images in pixels; None for the renderer's.

        Returns:
            New arrays by kind.
        """
        with self._guard:
            drawer = self._opened()
            size = self._checked_size(self._height if height is None else height, self._width if width is None else width)
            images = {kind: self._empty(kind, *size) for kind in kinds}
            drawn = drawer.draw(**images, point_lights=self._point_lights)
        if not drawn:
            self._warn(_NO_CAMERA)
        return images

    def render_batch(
        self,
        datas: Sequence[mujoco.MjData],
        cameras: Any = -1,
        scene_option: mujoco.MjvOption | None = None,
        *,
        out: OutputArray | None = None,
    ) -> np.ndarray:
        """Renders one rgb image of each `data` on all CPU cores. ``scene`` does not change. Several threads may call this.

        Args:
            datas: data of the renderer's model.
            cameras: a camera as for ``update_scene``, or a sequence with one for each data.
            scene_option: as for ``update_scene``.
            out: uint8 [B, H, W, 3] array for the images.

        Returns:
            uint8 [B, H, W, 3]: `out` or a new array.
        """
        self._opened()
        datas = list(datas)
        for index, data in enumerate(datas):
            if not isinstance(data, self._mujoco.MjData):
                raise TypeError(f"Renderer.render_batch(): datas[{index}] must be a mujoco.MjData, not {data!r:.100}")
        each = list(cameras) if isinstance(cameras, (list, tuple, np.ndarray)) else [cameras] * len(datas)
        if len(each) != len(datas):
            raise ValueError(f"Renderer.render_batch: got {counted(len(each), 'camera')} for {len(datas)} datas")
        shape = (len(datas), self._height, self._width, 3)
        images = np.empty(shape, np.uint8) if out is None else out
        if images.shape != shape or images.dtype != np.uint8 or not images.flags.c_contiguous or not images.flags.writeable:
            raise ValueError(f"Renderer.render_batch: out must be a contiguous, writable uint8 array of shape {shape}")

        def draw(pool: _Pool, index: int) -> None:
            renderer = pool.take()
            try:
                if renderer._look != self._look:
                    renderer._set_look(*self._look)
                renderer._update(datas[index], each[index], scene_option)
                renderer._opened().draw(rgb=images[index], point_lights=self._point_lights)
            except ValueError as error:
                raise ValueError(f"{error} (datas[{index}])") from None
            finally:
                pool.free.put(renderer)

        with self._batch_guard.lock:  # close() comes before all images or after them
            self._opened()
            pool = self._pool()
            running = [pool.threads.submit(draw, pool, index) for index in range(len(datas))]
        try:
            wait(running)
        finally:  # Ctrl-C
            for one in running:
                one.cancel()
        for one in running:
            one.result()
        for index, data in enumerate(datas):
            if not _has_poses(data):
                self._warn(f"{_NO_POSES} before render_batch() (datas[{index}])")
                break
        return images

    def _pool(self) -> _Pool:
        if self._batch is None or self._batch.process != os.getpid():  # threads do not survive a fork
            self._batch = _Pool(lambda: Renderer(self._model, self._height, self._width, self._scene.maxgeom))
        return self._batch

    @guarded
    def reload(self) -> None:
        """Makes the next image show the current textures, height fields and meshes of the model.

        Not needed after changes of whole textures, height fields or meshes, which are detected; a change of a small part of a
        large one may be missed.
        """
        self._opened().native.reload()
        self._set_look(*self._look)  # a skybox or an image light may have changed

    def _empty(self, kind: str, height: int, width: int) -> np.ndarray:
        if kind not in _KINDS:
            raise ValueError(f"Renderer: unknown kind of image '{kind}'; expected one of {', '.join(_KINDS)}")
        dtype, channels = _KINDS[kind]
        return np.empty((height, width, *channels), dtype)

    def close(self) -> None:
        """Frees the renderer's memory, after the calls of other threads. The renderer is also a context manager that does this at
        its end."""
        with self._guard.lock:
            self._drawer = None
        with self._batch_guard.lock:
            batch, self._batch = self._batch, None
        if batch is not None and batch.process == os.getpid():
            batch.threads.shutdown()

    def __reduce__(self) -> Any:
        raise TypeError("Renderer: cannot be copied or pickled; make one in each process, from the model")

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
