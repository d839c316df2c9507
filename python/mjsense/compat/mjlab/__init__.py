# SPDX-License-Identifier: Apache-2.0
"""Scenes and sensors as they are configured in mjlab 1.6: change ``mjlab`` to ``mjsense.compat.mjlab`` where they are imported.

    from mjsense.compat.mjlab.entity import EntityArticulationInfoCfg, EntityCfg
    from mjsense.compat.mjlab.scene import Scene, SceneCfg
    from mjsense.compat.mjlab.sensor import ContactMatch, ContactSensorCfg, ObjRef
    from mjsense.compat.mjlab.sim import MujocoCfg, Simulation, SimulationCfg
    from mjsense.compat.mjlab.terrains import TerrainEntityCfg

Fields, defaults and order of arguments are mjlab's. Configurations can be changed until the scene is created, and are then
checked. Sensors return torch tensors that share the sensors' memory, or NumPy arrays if torch is not installed. Everything is on
the CPU.

Not supported: managers, rewards and other parts of training, actuators that mjlab computes in Python, and sub-terrains not in its
``ROUGH_TERRAINS_CFG``. A configuration that names one of these raises an error.

``use()`` is for whole programs of mjlab, which keep their imports.
"""

TESTED = "1.6"
"""The series of mjlab that ``use()`` is tested with."""


def use(threads: int = 0) -> None:
    """mjlab's environments on the CPU are stepped by mjsense from now on: ``mjsense.compat.mujoco_warp.use()``. Their videos
    (``render_mode="rgb_array"``) are drawn by ``mjsense.Renderer``, without OpenGL.

    Call it before an environment is made.

    Raises:
        ImportError: If mjlab or mujoco_warp is not installed, or is of a version that was not tested.
    """
    import importlib.metadata

    try:
        version = importlib.metadata.version("mjlab")
    except importlib.metadata.PackageNotFoundError:
        raise ImportError("mjsense.compat.mjlab.use() needs the package mjlab: pip install mjlab") from None
    if not version.startswith(f"{TESTED}."):
        raise ImportError(f"mjsense.compat.mjlab.use() is tested with mjlab {TESTED}, and {version} is installed")
    from mjsense.compat import mujoco_warp

    mujoco_warp.use(threads)
    _draw_videos_without_opengl()


def _draw_videos_without_opengl() -> None:
    from mjlab.viewer.offscreen_renderer import OffscreenRenderer  # pyright: ignore[reportMissingImports]

    from mjsense.sim.renderer import Renderer

    def initialize(self: OffscreenRenderer) -> None:
        if self._renderer is not None:
            raise RuntimeError("Renderer is already initialized. Call 'close()' first to reinitialize.")
        self._renderer = Renderer(self._model, self._cfg.height, self._cfg.width)

    OffscreenRenderer.initialize = initialize
