import copy
import dataclasses
import pickle

import pytest

import mjsense as mjs
from mjsense import _core

CLASSES = {
    "builtin": mjs.BuiltinSensorCfg,
    "contact": mjs.ContactSensorCfg,
    "lidar": mjs.LidarSensorCfg,
    "raycast": mjs.RayCastSensorCfg,
    "terrain_height": mjs.TerrainHeightSensorCfg,
    "camera": mjs.CameraSensorCfg,
    "effect": mjs.EffectSensorCfg,
    "imu": mjs.ImuSensorCfg,
    "options": mjs.MujocoCfg,
    "terrain": mjs.TerrainCfg,
    "sub_terrain": mjs.SubTerrainCfg,
}


def plain(value):
    """Ours and C++'s way to say nothing, and words without case."""
    if value is None or value == "" or value == ():
        return None
    if isinstance(value, dict):
        return None if not any(plain(v) for k, v in value.items() if k != "mode") else {k: plain(v) for k, v in value.items()}
    if dataclasses.is_dataclass(value):
        return plain(dataclasses.asdict(value))
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, float):
        return round(value, 6)  # colours are single precision there
    return value.lower() if isinstance(value, str) else value


@pytest.mark.parametrize("kind", list(_core.cfg_defaults()))
def test_defaults_are_those_of_cpp(kind):
    ours = {f.name: f for f in dataclasses.fields(CLASSES[kind])}
    theirs = _core.cfg_defaults()[kind]
    assert set(ours) - set(theirs) <= {"pattern", "any_frame"}
    for name, value in theirs.items():
        field = ours[name]
        if field.default is not dataclasses.MISSING:
            assert plain(field.default) == plain(value), name
        elif field.default_factory is not dataclasses.MISSING and name not in ("pattern", "scan"):
            assert plain(field.default_factory()) == plain(value), name


def imu(**kwargs):
    return mjs.BuiltinSensorCfg(
        **{"name": "imu", "sensor_type": "gyro", "obj": mjs.ObjRef("site", "imu", "robot"), **kwargs}
    )


def test_dataclass_manners():
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
