# SPDX-License-Identifier: Apache-2.0
"""Methods of configurations: the generated dataclasses of the same names (configs.py, effects.py) inherit from these classes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, cast

from mjsense import _core
from mjsense.core import mujoco_names, spec_views
from mjsense.core.arguments import KnownAttributes, short

if TYPE_CHECKING:
    from typing import Self

    import mujoco


class Config(KnownAttributes):
    """Base class of all configurations. C++ checks them at construction, and a misspelt attribute raises AttributeError."""

    if TYPE_CHECKING:

        def __init__(self, *args: Any, **kwargs: Any) -> None: ...  # for type checkers: each dataclass has its own

    def __post_init__(self) -> None:
        _core.check_cfg(self)


class ObjRef(Config):
    type: str
    name: str
    entity: str | None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.type:
            _core.check_obj_type(self.type)

    @property
    def full_name(self) -> str:
        return f"{self.entity}/{self.name}" if self.entity else self.name


class EntityCfg(Config):
    model: Any
    assets: Any

    def __post_init__(self) -> None:
        if not (isinstance(self.model, (str, Path)) or mujoco_names.is_spec(self.model) or callable(self.model)):
            raise TypeError(
                f"EntityCfg: model must be a path, XML text, a mujoco.MjSpec or a function that makes one, not {self.model!r}"
            )
        super().__post_init__()

    def _source(self) -> tuple[str, Any, dict[str, bytes]]:
        """Returns (kind, value, assets) with kind path, xml or spec."""
        model, assets = self.model, dict(self.assets)
        if callable(model):
            model = cast(Any, model())
        if mujoco_names.is_spec(model):
            return *mujoco_names.source_of(model), {**model.assets, **assets}
        if isinstance(model, str) and model.lstrip().startswith("<"):
            return "xml", model, assets
        if isinstance(model, (str, Path)):
            return "path", str(model), assets
        raise TypeError(f"EntityCfg.model must be a path, XML text or a mujoco.MjSpec, not {model!r}")


class SceneFileCfg(Config):
    name: str
    models: Callable[[], Any] | None
    _mjs_scene: Callable[[], tuple[Any, ...]]
    """Called by C++ if there are ``models``. Set when the scene is used, see ``tasks/parts.py``."""

    def __post_init__(self) -> None:
        if not (self.models is None or callable(self.models)):
            raise TypeError(
                f"SceneFileCfg '{self.name}': models must be a function that makes a mjsense.SceneCfg, not {self.models!r}"
            )
        super().__post_init__()


class SceneCfg(Config):
    num_envs: int
    entities: Mapping[str, Any]
    sensors: Sequence[Any]
    base: str | Path | None
    spec_fn: Callable[[mujoco.MjSpec], None] | None

    def __post_init__(self) -> None:
        try:
            entities = dict(self.entities).values()
        except (TypeError, ValueError):
            entities = [None]
        if not all(isinstance(entity, EntityCfg) for entity in entities):
            raise TypeError(f"SceneCfg: entities must be a mapping of names to EntityCfg, not {self.entities!r}")
        if not isinstance(self.sensors, Iterable) or isinstance(self.sensors, (str, SensorCfg)):
            raise TypeError(f"SceneCfg: sensors must be a sequence of sensors, such as (sensor,), not {short(self.sensors)}")
        if not isinstance(self.base, (str, Path, NoneType)):
            raise TypeError(f"SceneCfg: base must be a path or XML text, not {self.base!r}")
        if not (self.spec_fn is None or callable(self.spec_fn)):
            raise TypeError(f"SceneCfg: spec_fn must be a function, not {self.spec_fn!r}")
        if not isinstance(self.num_envs, int) or isinstance(self.num_envs, bool):
            raise TypeError(f"SceneCfg: num_envs must be an int, not {self.num_envs!r}")
        if self.num_envs < 1:
            raise ValueError(f"SceneCfg: num_envs is {self.num_envs}: must be at least 1")
        super().__post_init__()

    def _base_spec(self) -> Any:
        """The spec in which the scene is built."""
        return spec_views.new_spec(None if self.base is None else str(self.base))


class SensorCfg(Config):
    name: str

    def __post_init__(self) -> None:
        if not hasattr(self, "build"):
            super().__post_init__()
        elif not isinstance(self.name, str) or not self.name:
            raise TypeError(f"{type(self).__name__}: name must be a str that is not empty, not {self.name!r}")

    @property
    def prefixed_name(self) -> str:
        """Key of the sensor in the scene."""
        return self.name if hasattr(self, "build") else _core.cfg_key(self)


class RayPattern(Config):
    def generate_rays(self) -> tuple[Any, Any]:
        """Origins (m) and unit directions of the rays in the local frame, float32 ``[n, 3]`` each."""
        return _core.pattern_rays(self)


class GridPatternCfg(RayPattern):
    pass


class UserPatternCfg(RayPattern):
    pass


class PinholeCameraPatternCfg(RayPattern):
    @classmethod
    def from_intrinsic_matrix(cls, intrinsic_matrix: Any, width: int, height: int) -> Self:
        """Creates the pattern from a 3x3 matrix, given as 9 numbers or as rows. Only its fy is used; raises ValueError unless it
        is positive."""
        flat = [float(x) for row in intrinsic_matrix for x in (row if hasattr(row, "__iter__") else (row,))]
        if len(flat) != 9:
            raise ValueError(f"intrinsic_matrix must be 3x3, not {intrinsic_matrix!r}")
        return cls(width=width, height=height, fovy=_core.pinhole_fovy(flat, height))

    @classmethod
    def from_mujoco_camera(cls, camera_name: str) -> Self:
        """Creates the pattern with the resolution and field of view of a camera of the model."""
        return cls(camera_name=camera_name)


class RingPatternCfg(RayPattern):
    Ring: Any

    @classmethod
    def single_ring(cls, radius: float = 0.1, num_samples: int = 8, **kwargs: Any) -> Self:
        return cls(rings=(cls.Ring(radius, num_samples),), **kwargs)


class Noise(Config):
    @classmethod
    def with_density(cls, density: float | Sequence[float], **kwargs: Any) -> Self:
        return cls(density=density, **kwargs)


class Clip(Config):
    @classmethod
    def saturation(cls, limit: float, **kwargs: Any) -> Self:
        return cls(-limit, limit, **kwargs)
