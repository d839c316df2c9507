# SPDX-License-Identifier: Apache-2.0
import copy
import dataclasses
import json
import pickle
from typing import Any

import pytest

import mjsense as mjs
from mjsense import _core

SCHEMA = json.loads(_core.schema())["structs"]


def imu(**kwargs):
    return mjs.BuiltinSensorCfg(
        **{"name": "imu", "sensor_type": "gyro", "obj": mjs.ObjRef("site", "imu", "robot"), **kwargs}
    )


def test_configs_behave_like_dataclasses():
    cfg = imu(cutoff=3)
    assert cfg == imu(cutoff=3) != imu()
    assert pickle.loads(pickle.dumps(cfg)) == copy.deepcopy(cfg) == cfg
    assert dataclasses.replace(cfg, name="b").name == "b"
    assert cfg.prefixed_name == "robot/imu"


@pytest.mark.parametrize(
    "kwargs, text",
    [
        (dict(obj=None), "imu.*requires obj"),
        (dict(obj=mjs.ObjRef("joint", "j")), "requires obj.type"),
        (dict(sensor_type="gyr"), "gyro"),
        (dict(cutoff="x"), "cutoff must be a number, not 'x'"),
        (dict(nsample=2.5), "nsample must be an int"),
        (dict(enclosed=1), "enclosed must be a bool"),
        (dict(name=3), "name must be a str"),
    ],
)
def test_errors_when_a_config_is_made(kwargs, text):
    with pytest.raises((ValueError, KeyError, TypeError), match=text):
        imu(**kwargs)


def test_contact_errors():
    match = mjs.ContactMatch(mode="geom", pattern="a", entity="b")
    for kwargs in (dict(reduce="sum"), dict(num_slots=0), dict(fields=("fond",)), dict(fields=()), dict(global_frame=True)):
        with pytest.raises((ValueError, KeyError)):
            mjs.ContactSensorCfg(name="c", primary=match, **kwargs)


# Valid arguments of classes that have conditions beyond the declared ones; `valid()` derives those of all other classes from the schema.
SITE, BODY = mjs.ObjRef("site", "imu", "robot"), mjs.ObjRef("body", "trunk", "robot")
MATCH = mjs.ContactMatch("geom", ".*", "robot")
RIGHT = {
    mjs.BuiltinSensorCfg: dict(name="a", sensor_type="gyro", obj=SITE),
    mjs.ContactSensorCfg: dict(name="a", primary=MATCH),
    mjs.RayCastSensorCfg: dict(name="a", frame=BODY),
    mjs.TerrainHeightSensorCfg: dict(name="a", frame=BODY),
    mjs.LidarSensorCfg: dict(name="a", frame=BODY),
    mjs.CameraSensorCfg: dict(name="a"),
    mjs.ImuSensorCfg: dict(name="a", site=SITE),
    mjs.EffectSensorCfg: dict(name="a", sensor="b"),
    mjs.ContactMatch: dict(mode="geom", pattern=".*", entity="robot"),
    mjs.CameraIntrinsics: dict(fx=1.0, fy=1.0, cx=1.0, cy=1.0),
    mjs.EntityCfg: dict(model="a.xml"),
    mjs.RingPatternCfg.Ring: {},
    mjs.UserPatternCfg: {},
    mjs.TableScanCfg: dict(angles=((0.0, 0.0),)),
    mjs.effects.Rate: dict(rate_hz=10.0),
    mjs.sensors.SceneEntityCfg: dict(name="mug", model="mug.xml"),
    mjs.SceneFileCfg: dict(name="bench"),
    mjs.tasks.SceneObjectCfg: dict(body="mug/mug"),
    mjs.tasks.SceneRegionCfg: dict(name="top", on="bench/top"),
    mjs.tasks.SceneVaryCfg: dict(what="light", pattern=".*"),
    mjs.tasks.SceneMoodCfg: dict(name="evening"),
}
# Arguments that violate conditions other than the declared ranges, and the texts of some errors of declared ranges.
WRONG = [
    (mjs.ContactMatch, dict(mode="goem"), "mode is 'goem': must be one of geom, body, subtree; did you mean 'geom'"),
    (mjs.ContactMatch, dict(pattern=()), "no pattern"),
    (mjs.ContactMatch, dict(pattern="("), "missing|unterminated|parenthes"),
    (mjs.ContactMatch, dict(exclude=("[",)), "ContactMatch"),
    (mjs.ContactSensorCfg, dict(num_slots=0), "num_slots is 0"),
    (mjs.ContactSensorCfg, dict(secondary=mjs.ContactMatch("geom", ("a", "b"))), "secondary: 2 patterns"),
    (mjs.ContactSensorCfg, dict(viz=mjs.sensors.ContactVizCfg(), reduce="maxfroce"), "maxforce"),
    (mjs.sensors.ContactVizCfg, dict(point_color=(2.0, 0, 0, 1)), "point_color"),
    (mjs.sensors.ContactVizCfg, dict(axis_length=-1.0), "axis_length"),
    (mjs.sensors.RayCastVizCfg, dict(hit_radius=-1.0), "hit_radius"),
    (mjs.sensors.CameraVizCfg, dict(line_width=-1.0), "line_width"),
    (mjs.GridPatternCfg, dict(resolution=0.0), "GridPatternCfg: resolution is 0"),
    (mjs.GridPatternCfg, dict(direction=(0, 0, 0)), "direction"),
    (mjs.PinholeCameraPatternCfg, dict(fovy=180.0), "fovy is 180"),
    (mjs.PinholeCameraPatternCfg, dict(width=0), "width is 0"),
    (mjs.RingPatternCfg, dict(include_center=False), "no rays"),
    (mjs.RingPatternCfg.Ring, dict(num_samples=0), "num_samples is 0"),
    (mjs.UserPatternCfg, dict(times=(1.0,)), "times.0. is 1: must be at most 0"),
    (mjs.UserPatternCfg, dict(offsets=((0, 0, 0),) * 2, directions=((0, 0, -1),) * 3), "give equal numbers, or one of either"),
    (mjs.SpinningScanCfg, dict(channels=0), "SpinningScanCfg: channels is 0"),
    (mjs.TableScanCfg, dict(angles=()), "no rows"),
    (mjs.TableScanCfg, dict(rays_per_scan=5), "rays_per_scan is 5"),
    (mjs.LidarSensorCfg, dict(dropout=1.5), "dropout is 1.5"),
    (mjs.RayCastSensorCfg, dict(frame=mjs.ObjRef("joint", "a")), "frame 'a' is a 'joint'"),
    (mjs.ObjRef, dict(type="goem", name="a"), "ObjRef: unknown object type 'goem'"),
    (mjs.RayCastSensorCfg, dict(ray_alignment="yow"), "must be one of base, yaw, world"),
    (mjs.RayCastSensorCfg, dict(name=""), "needs a name"),
    (mjs.TerrainHeightSensorCfg, dict(reduction="men"), "did you mean"),
    (mjs.CameraSensorCfg, dict(data_types=("rbg",)), "did you mean 'rgb'"),
    (mjs.CameraIntrinsics, dict(fx=0.0), "fx is 0: must be above 0"),
    (mjs.LensDistortion, dict(model="fisheye"), "takes 4 coefficients"),
    (mjs.LensDistortion, dict(model="fishey"), "did you mean 'fisheye'"),
    (mjs.sensors.ImuAxis, dict(range=-1.0), "range is -1"),
    (mjs.sensors.ImuAxis, dict(bias_drift=1.0), "bias_drift_time_s is 0"),
    (mjs.ImuSensorCfg, dict(preset="mpu6500"), "mpu6050"),
    (mjs.ImuSensorCfg, dict(effects=(3,)), "effects must be one of Noise, .*, not 3"),
    (mjs.EffectSensorCfg, dict(sensor=""), "the sensor to read is missing"),
    (mjs.EffectSensorCfg, dict(history_length=-1), "history_length is -1"),
    (mjs.effects.Dropout, dict(probability=2.0), "Dropout: probability is 2: must be between 0 and 1"),
    (mjs.effects.Dropout, dict(mode="hodl"), "Dropout: mode is 'hodl': must be one of hold, nan, zero"),
    (mjs.effects.Noise, dict(operation="ad"), "Noise: operation is 'ad'"),
    (mjs.effects.Noise, dict(density=-1.0), "density is -1"),
    (mjs.effects.Noise, dict(draw="x"), "draw"),
    (mjs.effects.Gaussian, dict(std=-1.0), "Gaussian: std is -1"),
    (mjs.effects.Uniform, dict(low=1.0), "low 1 is above high 0"),
    (mjs.effects.EpisodeBias, dict(operation="set"), "operation"),
    (mjs.effects.BiasDrift, dict(std=1.0), "needs a finite time_constant_s"),
    (mjs.effects.BiasDrift, dict(time_constant_s=0.0), "time_constant_s is 0"),
    (mjs.effects.Misalignment, dict(angle_std=-1.0), "angle_std is -1"),
    (mjs.effects.Clip, dict(low=1.0, high=0.0), "low 1 is above high 0"),
    (mjs.effects.Quantize, dict(step=-1.0), "step is -1"),
    (mjs.effects.NanPolicy, dict(action="ignore"), "disabled, warn, sanitize"),
    (mjs.effects.Delay, dict(delay_s=-1.0), "delay_s is -1"),
    (mjs.effects.StepDelay, dict(min_lag=2, max_lag=1), "must satisfy 0 <= min_lag <= max_lag"),
    (mjs.effects.Rate, dict(rate_hz=0.0), "rate_hz is 0"),
    (mjs.MujocoCfg, dict(timestep=0.0), "timestep is 0"),
    (mjs.MujocoCfg, dict(integrator="rk5"), "integrator is 'rk5'.*rk4"),
    (mjs.MujocoCfg, dict(disableflags=("contct",)), "contact"),
    (mjs.TerrainCfg, dict(terrain_type="hills"), "plane, generator"),
    (mjs.TerrainCfg, dict(levels=0), "levels is 0"),
    (mjs.SubTerrainCfg, dict(kind="stair"), "did you mean 'stairs'"),
    (mjs.EntityCfg, dict(quat=(0, 0, 0, 0)), "not a rotation"),
    (mjs.EntityCfg, dict(model=3), "model must be a path"),
    (mjs.EntityCfg, dict(joint_pos={"(": 0.0}), "joint_pos"),
    (mjs.SceneCfg, dict(num_envs=0), "num_envs is 0"),
    (mjs.SceneCfg, dict(extent=-1.0), "extent is -1"),
    (mjs.ObjRef, dict(name=3), "name must be a str"),
    (mjs.BuiltinSensorCfg, dict(interp="cubik"), "cubic"),
    (mjs.sensors.SceneEntityCfg, dict(pos=(float("inf"), 0, 0)), "pos"),
    (mjs.SceneFileCfg, dict(count=(3, 2)), "count is 3, 2"),
    (mjs.SceneFileCfg, dict(models=3), "models must be a function"),
    (mjs.tasks.SceneObjectCfg, dict(rests=("sideways",)), "upright, side, end"),
    (mjs.tasks.SceneRegionCfg, dict(area=(float("nan"), 0, 0, 0)), "area"),
    (mjs.tasks.SceneRobotCfg, dict(yaw_spread=-1.0), "yaw_spread is -1"),
    (mjs.tasks.SceneVaryCfg, dict(hue=200.0), "hue is 200"),
    (mjs.tasks.SceneVaryCfg, dict(tint=(-1.0, 0, 0)), "tint"),
    (mjs.tasks.SceneSkyCfg, dict(top=(2.0, 0, 0)), "top"),
    (mjs.tasks.SceneHeadlightCfg, dict(ambient=2.0), "ambient is 2"),
]  # fmt: skip
ALL: set[Any] = {
    value
    for module in (mjs, mjs.effects)
    for value in vars(module).values()
    if dataclasses.is_dataclass(value) and hasattr(value, "__post_init__") and value is not mjs.sensors.SensorCfg
} | {mjs.RingPatternCfg.Ring}




def fields_of(cls):
    """The fields that C++ declares with a type; other fields are defined in Python only."""
    return [field for field in SCHEMA[cls.__qualname__]["fields"] if "type" in field]


def inside(t, field):
    """A value of the type that the field's range allows."""
    if t["kind"] in ("number", "int", "unsigned"):
        low, high = field.get("low"), field.get("high")
        value = high if high is not None else low + 1 if low is not None else 1
        return float(value) if t["kind"] == "number" else int(value)
    if t["kind"] in ("list", "array"):
        return (inside(t["element"], field),) * max(1, len(field["default"]))
    if t["kind"] == "object":
        cls = getattr(mjs, t["name"])
        return cls(**valid(cls))
    return (t.get("words") or field["words"] or ["a"])[0]


def valid(cls):
    """Arguments that make an object: RIGHT, or its required fields by their declaration, and references to elements where it needs them."""
    if cls in RIGHT:
        return RIGHT[cls]
    required = {field["name"]: inside(field["type"], field) for field in fields_of(cls) if field["required"]}
    references = [field["name"] for field in fields_of(cls) if field["type"].get("name") == "ObjRef"]
    targets = [{}, *({name: mjs.ObjRef(kind, "a", "robot") for name in references} for kind in ("body", "site", "geom", "joint", "camera"))]
    for chosen in targets:
        try:
            cls(**required, **chosen)
        except (ValueError, KeyError, TypeError) as error:
            failure = error
        else:
            return required | chosen
    return pytest.fail(f"{cls.__name__}: its schema does not tell what is valid, add it to RIGHT: {failure}")


def outside(field):
    """Values that the declaration of a field excludes."""
    kind = field["type"]["kind"]
    if kind == "word":
        yield "no such word"
    elif kind in ("number", "int") and not field["or_none"]:
        number = int if kind == "int" else float
        if field.get("low") is not None:
            yield number(field["low"] if field["above_low"] else field["low"] - 1)
        if field.get("high") is not None:
            yield number(field["high"] + 1)


@pytest.mark.parametrize("cls, kwargs, text", WRONG, ids=lambda v: v.__name__ if isinstance(v, type) else None)
def test_invalid_configurations_are_rejected_at_construction(cls, kwargs, text):
    with pytest.raises((ValueError, KeyError, TypeError), match=text):
        cls(**{**RIGHT.get(cls, {}), **kwargs})


@pytest.mark.parametrize("cls", sorted(ALL, key=str), ids=lambda c: c.__name__)
def test_nan_and_wrong_types_are_rejected(cls):
    right = valid(cls)
    made = cls(**right)
    for field in dataclasses.fields(cls):
        value = getattr(made, field.name)
        nan = float("nan")
        wrong = [object()]
        if isinstance(value, float):
            wrong = [nan, "x", None]
        elif isinstance(value, bool):
            wrong = [3, "x"]
        elif isinstance(value, int):
            wrong = [1.5, "x", nan]
        elif isinstance(value, str) and field.name not in ("model",):
            wrong = [3]
        elif isinstance(value, tuple) and value and isinstance(value[0], float):
            wrong = [(nan, *value[1:]), "x"]
        for bad in wrong:
            if field.name in ("assets", "draw") or (isinstance(bad, str) and isinstance(value, str)):
                continue
            with pytest.raises((ValueError, KeyError, TypeError)):
                cls(**{**right, field.name: bad})
                pytest.fail(f"{cls.__name__}({field.name}={bad!r}) is taken")


@pytest.mark.parametrize("cls", sorted(ALL, key=str), ids=lambda c: c.__name__)
def test_values_outside_the_declared_range_are_rejected(cls):
    for field in fields_of(cls):
        for bad in outside(field):
            with pytest.raises((ValueError, KeyError), match=field["name"]):
                cls(**{**valid(cls), field["name"]: bad})
                pytest.fail(f"{cls.__name__}({field['name']}={bad!r}) is taken")


def test_scene_reports_the_same_error():
    """A configuration that becomes invalid after construction is rejected by the scene with the same message."""
    cfg = mjs.ContactSensorCfg(name="feet", primary=MATCH)
    cfg.num_slots = 0
    with pytest.raises(ValueError, match="sensor 'feet': num_slots is 0: must be at least 1"):
        mjs.Scene(mjs.SceneCfg(sensors=(cfg,)))
