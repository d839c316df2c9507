"""Configurations of scenes and sensors: plain dataclasses, all checked by C++ when they are made.

Units: metres, radians, seconds, newtons; other units are in the name. Quaternions are (w, x, y, z). Shapes: ``B`` worlds, ``P``
primaries, ``S`` slots (``N = P*S``), ``F`` frames, ``R`` rays (``F`` times the rays of the pattern), ``H`` history length.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import NoneType
from typing import Any, ClassVar

import mujoco

from mjsense import _core
from mjsense._arguments import KnownAttributes
from mjsense._field_docs import show_field_docs


class Config(KnownAttributes):
    """Base of all configurations: C++ checks them when they are made, and a misspelt attribute is an AttributeError."""

    def __post_init__(self) -> None:
        _core.check_cfg(self)


@dataclass(frozen=True)
class ObjRef(Config):
    """One MuJoCo element. Its full name is ``entity/name``, or ``name`` without an entity."""

    type: str = ""
    """body (inertial frame), xbody (body frame), joint, geom, site, actuator, tendon, camera ..."""
    name: str = ""
    entity: str | None = None

    @property
    def full_name(self) -> str:
        return f"{self.entity}/{self.name}" if self.entity else self.name


# ---------------------------------------------------------------------------------------------------------------- scene


@dataclass
class EntityCfg(Config):
    """A model that is attached to the scene; all its names get the prefix ``<entity>/``."""

    model: str | Path | mujoco.MjSpec | Callable[[], mujoco.MjSpec]
    """Path of an MJCF file, XML text, ``embedded:<file>`` (see :func:`mjsense.embedded_models`), an MjSpec, or a function that
    makes one."""
    assets: Mapping[str, bytes] = field(default_factory=dict)
    """Files that XML text refers to, by name."""
    pos: Sequence[float] = (0.0, 0.0, 0.0)
    """m, of the entity's root in the world."""
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    joint_pos: Mapping[str, float] = field(default_factory=dict)
    """Joint positions (rad, m) of the keyframe ``init_state`` by regular expression, unless the model has a keyframe."""
    mocap_base: bool = True
    """Hang a model without a free joint under the mocap body ``<entity>/mocap_base``, so that each world can place it."""

    def __post_init__(self) -> None:
        if not (isinstance(self.model, (str, Path, mujoco.MjSpec)) or callable(self.model)):
            raise TypeError(
                f"EntityCfg: model must be a path, XML text, a mujoco.MjSpec or a function that makes one, not {self.model!r}"
            )
        super().__post_init__()

    def _source(self) -> tuple[str, Any, dict[str, bytes]]:
        """(kind, value, assets): kind path, xml or spec."""
        model, assets = self.model, dict(self.assets)
        if callable(model):
            model = model()
        if isinstance(model, mujoco.MjSpec):
            return "spec", model, {**model.assets, **assets}
        if isinstance(model, str) and model.lstrip().startswith("<"):
            return "xml", model, assets
        if isinstance(model, (str, Path)):
            return "path", str(model), assets
        raise TypeError(f"EntityCfg.model must be a path, XML text or a mujoco.MjSpec, not {model!r}")


@dataclass
class SubTerrainCfg(Config):
    """One kind of tile. Pairs are (value at difficulty 0, value at difficulty 1)."""

    kind: str = "flat"
    """flat, rough, waves, slope, stairs, stepping_stones."""
    proportion: float = 1.0
    """Share of the columns."""
    inverted: bool = False
    """slope, stairs: down into a pit."""
    platform_width: float = 2.0
    """m, the flat square at the centre."""
    amplitude: Sequence[float] = (0.01, 0.08)
    """m, rough and waves."""
    spacing: float = 0.2
    """m between the knots of rough."""
    waves: int = 2
    slope: Sequence[float] = (0.0, 0.6)
    """Rise over run."""
    step_height: Sequence[float] = (0.03, 0.2)
    """m."""
    step_width: float = 0.3
    """m."""
    stone_width: Sequence[float] = (1.0, 0.35)
    """m."""
    gap: Sequence[float] = (0.05, 0.35)
    """m."""
    stone_height: Sequence[float] = (0.0, 0.05)
    """m by which stones stand higher or lower."""
    pit_depth: float = 1.0
    """m, stepping_stones."""


@dataclass
class TerrainCfg(Config):
    """The ground, registered as entity ``terrain``: a plane, or tiles of rising difficulty (levels along x, types along y)."""

    terrain_type: str = "plane"
    """plane or generator."""
    sub_terrains: Mapping[str, SubTerrainCfg] = field(default_factory=dict)
    """Empty: one of every kind."""
    levels: int = 5
    types: int = 0
    """Columns; 0: one for each sub-terrain."""
    tile_size: Sequence[float] = (8.0, 8.0)
    """m."""
    difficulty: Sequence[float] = (0.0, 1.0)
    """Of the first and the last level."""
    resolution: float = 0.1
    """m, of height fields."""
    border: float = 5.0
    """m, flat, around all tiles."""
    max_init_level: int = -1
    """Highest level that a world starts on; -1: any."""
    seed: int = 0


@dataclass
class MujocoCfg(Config):
    """Physics options of a scene. Entities' own ``<option>`` values are not carried over: one scene, one physics."""

    timestep: float = 0.002
    """s, of one substep."""
    integrator: str = "implicitfast"
    """euler, rk4, implicit or implicitfast."""
    cone: str = "pyramidal"
    """pyramidal or elliptic."""
    solver: str = "newton"
    """newton, cg or pgs."""
    jacobian: str = "auto"
    """auto, dense or sparse."""
    impratio: float = 1.0
    iterations: int = 100
    tolerance: float = 1e-8
    ls_iterations: int = 50
    ls_tolerance: float = 0.01
    ccd_iterations: int = 50
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    """m/s^2."""
    magnetic: Sequence[float] = (0.0, -0.5, 0.0)
    """What magnetometers read in the world frame."""
    wind: Sequence[float] = (0.0, 0.0, 0.0)
    """m/s."""
    density: float = 0.0
    """kg/m^3, of the medium."""
    viscosity: float = 0.0
    """Pa s."""
    disableflags: Sequence[str] = ()
    """Lower-case names of MJCF flags: ``("contact", "gravity")``."""
    enableflags: Sequence[str] = ()


@dataclass
class SceneCfg(Config):
    """What all worlds share."""

    num_envs: int = 1
    """B, unless ``Simulation(num_worlds=...)`` says otherwise."""
    env_spacing: float = 2.0
    """m, between the origins of neighbouring worlds on a plane."""
    terrain: TerrainCfg | None = None
    entities: Mapping[str, EntityCfg] = field(default_factory=dict)
    """Attached in this order."""
    sensors: Sequence[Any] = ()
    """Sensor configurations, configurations of your own with ``build()``, or :class:`mjsense.Sensor` objects."""
    extent: float | None = None
    """m, overrides ``stat.extent`` of the model."""
    spec_fn: Callable[[mujoco.MjSpec], None] | None = None
    """Edits the spec last, before compilation."""
    options: MujocoCfg = field(default_factory=MujocoCfg)
    base: str | Path | None = None
    """A whole model to start from, as it is (path or XML text): names without a prefix, any number of free joints, its own
    ``<option>`` unless ``options`` are set. Its sensors are found; it is no entity."""

    def __post_init__(self) -> None:
        try:
            entities = dict(self.entities).values()
        except (TypeError, ValueError):
            entities = [None]
        if not all(isinstance(entity, EntityCfg) for entity in entities):
            raise TypeError(f"SceneCfg: entities must be a mapping of names to EntityCfg, not {self.entities!r}")
        if not isinstance(self.sensors, Iterable) or isinstance(self.sensors, (str, SensorCfg)):
            raise TypeError(f"SceneCfg: sensors must be a sequence, not {self.sensors!r}")
        if not isinstance(self.base, (str, Path, NoneType)):
            raise TypeError(f"SceneCfg: base must be a path or XML text, not {self.base!r}")
        if not (self.spec_fn is None or callable(self.spec_fn)):
            raise TypeError(f"SceneCfg: spec_fn must be a function, not {self.spec_fn!r}")
        super().__post_init__()

    def _base_spec(self) -> mujoco.MjSpec:
        """The spec that the scene is built in."""
        if self.base is None:
            return mujoco.MjSpec()
        text = str(self.base)
        return mujoco.MjSpec.from_string(text) if text.lstrip().startswith("<") else mujoco.MjSpec.from_file(text)


# -------------------------------------------------------------------------------------------------------------- sensors


@dataclass
class SensorCfg(Config):
    """Base of the built-in sensor configurations."""

    kind: ClassVar[str] = ""
    name: str
    """Key in the scene: ``scene[name]``."""

    @property
    def prefixed_name(self) -> str:
        """Key in the scene's registry."""
        return _core.cfg_key(self)


@dataclass
class BuiltinSensorCfg(SensorCfg):
    """One of MuJoCo's own sensors; ``data`` is float32 ``[B, dim]``. Registered as ``entity/name``."""

    kind: ClassVar[str] = "builtin"
    sensor_type: str = ""
    """accelerometer, gyro, framepos, jointpos, rangefinder ...: the MJCF name."""
    obj: ObjRef | None = None
    """What is measured."""
    ref: ObjRef | None = None
    """Frame in which a frame sensor's value is expressed; the world without one."""
    cutoff: float = 0.0
    """Positive: every component is limited to [-cutoff, cutoff] (a rangefinder's -1 too)."""
    delay: float = 0.0
    """s between a reading and its showing. Needs nsample."""
    interval: float = 0.0
    """s between readings; 0: every physics step. Needs nsample."""
    phase: float = 0.0
    """s in (-interval, 0]."""
    nsample: int = 0
    """Readings kept, newest first, in the field ``history``."""
    interp: str = "zoh"
    """Between readings: zoh, linear, cubic."""
    noise: float = 0.0
    """Standard deviation; stored in the model, never applied by MuJoCo."""
    data: Sequence[str] = ("dist",)
    """Rangefinder: any of dist, dir, origin, point, normal, depth, in this order."""
    enclosed: bool = False
    """insidesite: by how much the whole object juts out, m."""
    dim: int = 0
    """User sensors."""
    datatype: str = "real"
    """User sensors: real, positive, axis, quaternion."""
    needstage: str = "acc"
    """User sensors: pos, vel, acc."""
    plugin: str = ""
    """Plugin sensors: identifier."""
    instance: str = ""
    """Plugin sensors: full name of an instance in an entity's XML."""


@dataclass(frozen=True)
class ContactMatch(Config):
    """Which geoms or bodies take part in a contact."""

    mode: str
    """geom, body, or subtree (a body and all its descendants)."""
    pattern: str | Sequence[str]
    """With an entity: regular expressions that must match a whole local name. Without: full MuJoCo names, literally."""
    entity: str | None = None
    exclude: Sequence[str] = ()
    """Names to leave out; one with any of ``.*+?[]{}()\\|^$`` is a regular expression that is searched."""


@dataclass
class ContactVizCfg(Config):
    """What a viewer draws of every contact in a slot. Colours are rgba, sizes in units of the model's ``stat.meansize``."""

    show_points: bool = True
    show_frames: bool = True
    """Axes of the contact: x (red) is the normal, from the primary to the secondary."""
    show_forces: bool = True
    """The force that the primary exerts on the secondary, as an arrow that ends at the contact point."""
    force_scale: float = 0.0
    """m per N; 0: the model's ``vis.map.force``, as MuJoCo's own arrows."""
    point_color: Sequence[float] = (1.0, 0.5, 0.0, 1.0)
    force_color: Sequence[float] = (0.9, 0.1, 0.9, 1.0)
    point_radius: float = 0.3
    axis_length: float = 2.0
    force_width: float = 0.3


@dataclass
class ContactSensorCfg(SensorCfg):
    """Contacts of primaries, optionally with one secondary only. ``data`` is a :class:`mjsense.ContactData`.

    The normal points from the primary to the secondary; forces are what the **primary exerts on the secondary**: a box on the
    floor reads (0, 0, -m g) in the world frame.
    """

    kind: ClassVar[str] = "contact"
    primary: ContactMatch = None  # type: ignore[assignment]
    secondary: ContactMatch | None = None
    fields: Sequence[str] = ("found", "force")
    """Any of found, force, torque, dist, pos, normal, tangent."""
    reduce: str = "maxforce"
    """none, mindist, maxforce, netforce: which contacts come first (netforce: their sum)."""
    num_slots: int = 1
    """S, contacts kept for each primary."""
    secondary_policy: str = "first"
    """When several elements match the secondary: first, error, any (no filter), each (report who touches whom)."""
    track_air_time: bool = False
    """Timers of flight and contact; needs found."""
    global_frame: bool = False
    """Forces and torques in the world frame instead of the contact frame (x = normal); needs normal and tangent."""
    history_length: int = 0
    """H, substeps kept of every field."""
    track_events: bool = False
    """touchdown and liftoff: exact, also when both happened within one control step."""
    latch: bool = False
    """What happened at any time in the control step: found_any, force_peak, dist_at_peak, pos_at_peak, first_touch_time."""
    friction_split: bool = False
    """normal_force and friction_force."""
    other_ids: bool = False
    """other_geom and other_body."""
    debug: bool = False
    """Print what was matched."""
    debug_vis: bool = False
    """Drawn by ``Simulation.draw(scene)`` unasked."""
    viz: ContactVizCfg = field(default_factory=ContactVizCfg)


@dataclass(frozen=True)
class GridPatternCfg(Config):
    """Parallel rays from the points of a grid, x fastest."""

    kind: ClassVar[str] = "grid"
    size: Sequence[float] = (1.0, 1.0)
    """m, in x and y."""
    resolution: float = 0.1
    """m between rays."""
    direction: Sequence[float] = (0.0, 0.0, -1.0)

    def generate_rays(self) -> tuple[Any, Any]:
        """Offsets (m) and unit directions, float32 ``[n, 3]`` each, in the local frame."""
        return _core.pattern_rays(self)


@dataclass(frozen=True)
class PinholeCameraPatternCfg(Config):
    """Rays of a pinhole camera that looks along -Z: edge-inclusive, bottom row first."""

    kind: ClassVar[str] = "pinhole"
    width: int = 16
    height: int = 12
    fovy: float = 45.0
    """Vertical, degrees."""
    camera_name: str | None = None
    """Take resolution and angles from this camera of the model instead."""

    @classmethod
    def from_intrinsic_matrix(cls, intrinsic_matrix: Sequence[float], width: int, height: int) -> PinholeCameraPatternCfg:
        """From a 3x3 matrix, as 9 numbers or rows; only its fy is used."""
        flat = [x for row in intrinsic_matrix for x in (row if hasattr(row, "__iter__") else (row,))]
        if len(flat) != 9 or not flat[4] > 0:
            raise ValueError(f"intrinsic_matrix must be 3x3 with a positive fy, not {intrinsic_matrix!r}")
        return cls(width=width, height=height, fovy=math.degrees(2 * math.atan(height / (2 * float(flat[4])))))

    @classmethod
    def from_mujoco_camera(cls, camera_name: str) -> PinholeCameraPatternCfg:
        """Resolution and angles of a camera of the model."""
        return cls(camera_name=camera_name)

    def generate_rays(self) -> tuple[Any, Any]:
        """Offsets (m) and unit directions, float32 ``[n, 3]`` each, in the local frame."""
        return _core.pattern_rays(self)


@dataclass(frozen=True)
class RingPatternCfg(Config):
    """Parallel rays from the points of circles in the XY plane, after the centre."""

    @dataclass(frozen=True)
    class Ring(Config):
        radius: float = 0.1
        """m."""
        num_samples: int = 8

    kind: ClassVar[str] = "ring"
    rings: Sequence[RingPatternCfg.Ring] = ()
    include_center: bool = True
    direction: Sequence[float] = (0.0, 0.0, -1.0)

    @classmethod
    def single_ring(cls, radius: float = 0.1, num_samples: int = 8, **kwargs: Any) -> RingPatternCfg:
        return cls(rings=(cls.Ring(radius, num_samples),), **kwargs)

    def generate_rays(self) -> tuple[Any, Any]:
        """Offsets (m) and unit directions, float32 ``[n, 3]`` each, in the local frame."""
        return _core.pattern_rays(self)


@dataclass(frozen=True)
class UserPatternCfg(Config):
    """Your own rays. One direction for all offsets, or one offset for all directions, will do."""

    kind: ClassVar[str] = "user"
    offsets: Sequence[Sequence[float]] = ((0.0, 0.0, 0.0),)
    """m, [n, 3]."""
    directions: Sequence[Sequence[float]] = ((0.0, 0.0, -1.0),)
    """[n, 3], of any length but 0."""
    times: Sequence[float] = ()
    """s <= 0, [n] or none: each ray leaves from where the frame was then."""

    def generate_rays(self) -> tuple[Any, Any]:
        """Offsets (m) and unit directions, float32 ``[n, 3]`` each, in the local frame."""
        return _core.pattern_rays(self)


@dataclass
class RayCastVizCfg(Config):
    """What a viewer draws of a ray sensor. Colours are rgba, sizes in units of the model's ``stat.meansize``."""

    show_rays: bool = False
    show_normals: bool = False
    hit_color: Sequence[float] = (0.0, 1.0, 1.0, 1.0)
    ray_color: Sequence[float] = (0.0, 1.0, 0.0, 0.8)
    miss_color: Sequence[float] = (1.0, 0.0, 0.0, 0.4)
    normal_color: Sequence[float] = (1.0, 1.0, 0.0, 1.0)
    hit_radius: float = 0.5
    ray_width: float = 0.1
    normal_length: float = 5.0


@dataclass
class RayCastSensorCfg(SensorCfg):
    """Rays from frames against everything visible. ``data`` is a :class:`mjsense.RayCastData`."""

    kind: ClassVar[str] = "raycast"
    frame: ObjRef | Sequence[ObjRef] = ()
    """Bodies (body frame), sites or geoms that the rays start from."""
    pattern: GridPatternCfg | PinholeCameraPatternCfg | RingPatternCfg | UserPatternCfg = field(default_factory=GridPatternCfg)
    """The rays of one frame."""
    ray_alignment: str = "base"
    """base: offsets and directions turn with the frame; yaw: only with its heading; world: not at all."""
    max_distance: float = 10.0
    """m; hits farther away are misses."""
    exclude_parent_body: bool = True
    """Rays pass through the body they start from (not through its children)."""
    include_geom_groups: Sequence[int] | None = (0, 1, 2)
    """None: all."""
    debug_vis: bool = False
    """Drawn by ``Simulation.draw(scene)`` unasked."""
    viz: RayCastVizCfg = field(default_factory=RayCastVizCfg)
    min_distance: float = 0.0
    """m; nearer hits are misses, and hide what is behind them."""
    hit_ids: bool = True
    """geom_id, body_id and material_id of what was hit."""
    any_frame: bool = False
    """Take xbody and camera frames too, which mjlab refuses."""

    def __post_init__(self) -> None:
        if not isinstance(self.any_frame, bool):
            raise TypeError(f"{type(self).__name__} '{self.name}': any_frame must be a bool, not {self.any_frame!r}")
        for ref in (self.frame,) if isinstance(self.frame, ObjRef) else self.frame:
            if not self.any_frame and getattr(ref, "type", "") in ("xbody", "camera"):
                raise ValueError(
                    f"sensor '{self.name}': frame '{ref.full_name}' is a {ref.type}: must be 'body', 'site', or 'geom' "
                    "(any_frame=True takes xbody and camera)"
                )
        super().__post_init__()


@dataclass
class TerrainHeightSensorCfg(RayCastSensorCfg):
    """Height of frames above what lies below them. ``data.heights`` is float32 ``[B, F]``, ``[B, F, n]`` without reduction."""

    kind: ClassVar[str] = "terrain_height"
    reduction: str = "min"
    """min, max, mean, none; over a frame's rays."""


@dataclass(frozen=True)
class SpinningScanCfg(Config):
    """Lasers over each other that turn about the frame's z axis; rays are ``[channels, samples]``."""

    kind: ClassVar[str] = "spinning"
    channels: int = 16
    """Lasers."""
    elevation_min_deg: float = -15.0
    """Of channel 0, above the xy plane."""
    elevation_max_deg: float = 15.0
    """Of the last channel; the others lie evenly between."""
    elevations_deg: Sequence[float] = ()
    """One a channel instead of evenly spaced ones."""
    samples: int = 360
    """Firings of each channel in a sweep."""
    azimuth_start_deg: float = 0.0
    """0: along +x; counter-clockwise."""
    azimuth_span_deg: float = 360.0
    """Up to 360."""
    rate_hz: float = 10.0
    """Turns a second; matters with motion distortion only."""


@dataclass(frozen=True)
class TableScanCfg(Config):
    """Rays from a table of (azimuth, elevation), rad: solid-state and non-repeating lidars."""

    kind: ClassVar[str] = "table"
    file: str = ""
    """.npy of shape (M, 2)."""
    angles: Sequence[Sequence[float]] = ()
    """The table itself, [M, 2]."""
    rays_per_scan: int = 0
    """Rows that a scan takes, the next ones at the next scan; 0: all. Rows left over at the end are not used."""
    rate_hz: float = 10.0
    """Scans a second."""


@dataclass
class LidarSensorCfg(RayCastSensorCfg):
    """A spinning or table lidar. ``data`` is a :class:`mjsense.RayCastData` with points and intensity; ``pattern`` is not for lidars."""

    kind: ClassVar[str] = "lidar"
    max_distance: float = 100.0
    min_distance: float = 0.1
    any_frame: bool = True
    scan: SpinningScanCfg | TableScanCfg = field(default_factory=SpinningScanCfg)
    motion_distortion: bool = False
    """Each ray leaves from where the frame was at its own moment of the sweep."""
    range_noise_std: float = 0.0
    """m."""
    range_noise_relative: float = 0.0
    """Standard deviation in parts of the range."""
    range_resolution: float = 0.0
    """m; 0: exact."""
    dropout: float = 0.0
    """Probability that a return is lost."""


@dataclass(frozen=True)
class CameraIntrinsics(Config):
    """Focal lengths and principal point in pixels of the image; replaces fovy."""

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class LensDistortion(Config):
    """Where a lens puts the image of a direction (X, Y, Z), z forward, y down: OpenCV's models.

    brown_conrady: x = X/Z, y = Y/Z, ``x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)``, y' alike.
    fisheye: ``r' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)``, theta the angle to the axis, up to 89 degrees.
    """

    model: str = "none"
    """none, brown_conrady, fisheye."""
    coefficients: Sequence[float] = ()
    """brown_conrady: k1 k2 p1 p2 k3; fisheye: k1 k2 k3 k4."""


@dataclass
class CameraVizCfg(Config):
    """What a viewer draws of a camera: the pyramid of what it sees, and its axes (it looks along -z, the blue one)."""

    show_frustum: bool = True
    show_frame: bool = True
    frustum_depth: float = 0.0
    """m from the camera plane (through a lens: along the rays); 0: ``far``, or without one 10 ``stat.meansize``."""
    frustum_color: Sequence[float] = (1.0, 0.6, 0.0, 1.0)
    line_width: float = 2.0
    """Pixels."""
    axis_length: float = 5.0
    """In units of ``stat.meansize``."""


@dataclass
class CameraSensorCfg(SensorCfg):
    """A camera of the model (``camera_name``), or a new one. ``data`` is a :class:`mjsense.CameraData`."""

    kind: ClassVar[str] = "camera"
    camera_name: str | None = None
    """Full name of an existing camera, ``robot/wrist``."""
    parent_body: str | None = None
    """Full name of the body that carries a new camera; the world without one."""
    pos: Sequence[float] = (0.0, 0.0, 1.0)
    """m, of a new camera in the parent body."""
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    """wxyz, of a new camera in the parent body: x right, y up, looking along -z."""
    fovy: float | None = None
    """Vertical, degrees; orthographic: height of the image, m. None: the camera's own, 45 for a new one. Beside ``camera_name`` it is
    this sensor's alone."""
    width: int = 160
    """Pixels; the resolution in the MJCF plays no part."""
    height: int = 120
    """Pixels."""
    data_types: Sequence[str] = ("rgb",)
    """Any of rgb, depth, segmentation, body_segmentation, entity_segmentation, normals, point_cloud, flow."""
    use_textures: bool = True
    """Textures of materials, and the skybox."""
    use_shadows: bool = False
    """Of lights that cast them."""
    enabled_geom_groups: Sequence[int] = (0, 1, 2)
    """Groups (0 to 5) that are seen."""
    orthographic: bool = False
    """Parallel rays. Beside ``camera_name`` it is this sensor's alone."""
    clone_data: bool = False
    """``data`` is a copy at every read."""
    enabled_site_groups: Sequence[int] = ()
    """Groups (0 to 5) of sites that are drawn, as MuJoCo draws them."""
    enabled_tendon_groups: Sequence[int] = ()
    """Groups (0 to 5) of tendons that are drawn, as MuJoCo draws them."""
    max_lights: int = 8
    """Of the lights that are on, the headlight first, so many shine, 0 to 32. MuJoCo's OpenGL has 8."""
    near: float = 0.0
    """m from the camera plane; what is nearer is not seen."""
    far: float = 0.0
    """m; 0: no limit."""
    clip_near: str = "none"
    """none, or model: ``near`` is where MuJoCo's renderers clip, ``visual/map/znear`` times the model's extent."""
    update_period: float = 0.0
    """s between images; 0: at every read."""
    phase: float = 0.0
    """s; images are taken at the first control step at or after phase + k * update_period, and at a reset."""
    samples: int = 1
    """Per pixel of rgb, 1 to 64, for smooth edges."""
    depth_kind: str = "planar"
    """planar: distance to the camera plane; ray: along the pixel's ray."""
    intrinsics: CameraIntrinsics | None = None
    """Instead of fovy and of what the MJCF says."""
    distortion: LensDistortion = field(default_factory=LensDistortion)
    """Of the lens; the image is as distorted as the lens leaves it."""
    depth_noise: str = "none"
    """none, d405, d435: what these stereo cameras make of ``depth``; the other fields stay exact."""
    renderer: str = "rays"
    """rays, or opengl: MuJoCo's own renderer, where it was built in."""
    debug_vis: bool = False
    """Drawn by ``Simulation.draw(scene)`` unasked."""
    viz: CameraVizCfg = field(default_factory=CameraVizCfg)


def replace(cfg: Any, **changes: Any) -> Any:
    """A copy of a configuration with some fields changed."""
    if not dataclasses.is_dataclass(cfg) or isinstance(cfg, type):
        raise TypeError(f"replace(): cfg must be a configuration, not {cfg!r}")
    return dataclasses.replace(cfg, **changes)


show_field_docs(__name__)
