# SPDX-License-Identifier: Apache-2.0
"""Every sensor over models that lack something. Run by test_poor_models.py in a process of its own; prints a line before each combination.

    python poor_models.py
"""

import sys
import warnings

import numpy as np

import mjsense as mjs

SITE = "<site name='s' pos='0 0 1'/>"
BODY = "<body name='b' pos='0 0 1'><joint name='j'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><site name='s'/></body>"
BALL = "<body name='b' pos='0 0 1'><freejoint name='j'/><geom name='g' size='.1'/><site name='s' pos='0 0 .2'/></body>"
SKIN = """<deformable><skin vertex="-.3 0 -.3 .3 0 -.3 .3 0 .3" face="0 1 2"><bone body="b" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2"
 vertweight="1 1 1"/></skin></deformable>"""
SKY = "<texture type='skybox' builtin='gradient' rgb1='1 1 1' rgb2='0 0 1' width='8' height='48'/>"


def model(body="", rest="", asset=""):
    return f"<mujoco>{f'<asset>{asset}</asset>' if asset else ''}<worldbody>{body}</worldbody>{rest}</mujoco>"


MODELS = {
    "nothing": model(),
    "a site": model(SITE),
    "a camera": model("<camera name='c'/>"),
    "a light": model("<light/>" + SITE),
    "a body without geoms": model(BODY),
    "a body, all disabled": model(BODY, "<option><flag contact='disable' gravity='disable' constraint='disable' sensor='disable'/></option>"),
    "a mocap body": model(f"<body name='b' mocap='true'>{SITE}</body>"),
    "a fixed body": model(f"<body name='b'>{SITE}</body>"),
    "a ball": model(BALL),
    "a ball and no headlight": model(BALL, "<visual><headlight active='0'/></visual>"),
    "a ball and a light": model("<light/>" + BALL),
    "a geom of alpha 0": model(SITE + "<geom name='g' size='.1' rgba='0 0 0 0'/>"),
    "a geom of group 4": model(SITE + "<geom name='g' size='.1' group='4'/>"),
    "a geom of group 5 and another material": model(SITE + "<geom name='g' size='.1' group='5' material='m'/>", asset="<material name='m'/>"),
    "a plane": model(SITE + "<geom name='g' type='plane' size='0 0 .1'/>"),
    "a small plane": model(SITE + "<geom name='g' type='plane' size='1e-6 1e-6 1e-6'/>"),
    "a tiny ball": model(SITE + "<geom name='g' size='1e-9'/>"),
    "an origin inside a ball": model(SITE + "<geom name='g' size='3'/>"),
    "a texture without user": model(SITE, asset=SKY + "<texture name='t' type='2d' builtin='flat' width='1' height='1'/><material name='m' texture='t'/>"),
    "a sky and a ball": model(BALL, asset=SKY),
    "a mesh without user": model(SITE, asset="<mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/>"),
    "a mesh": model(SITE + "<geom name='g' type='mesh' mesh='m'/>", asset="<mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/>"),
    "a height field without user": model(SITE, asset="<hfield name='h' nrow='2' ncol='2' size='1 1 .1 .1'/>"),
    "a flat height field": model(SITE + "<geom name='g' type='hfield' hfield='h'/>", asset="<hfield name='h' nrow='2' ncol='2' size='1 1 .1 .1'/>"),
    "a skin and no geom": model(BODY, SKIN),
    "only a cloth": model(SITE + "<flexcomp name='f' type='grid' count='3 3 1' spacing='.1 .1 .1' dim='2' radius='.01' mass='1'/>"),
    "only a rope": model(SITE + "<flexcomp name='f' type='grid' count='3 1 1' spacing='.1 .1 .1' dim='1' radius='.01' mass='1'/>"),
    "only a thin cloth": model(SITE + "<flexcomp name='f' type='grid' count='3 3 1' spacing='.1 .1 .1' dim='2' radius='0' mass='1' rigid='true'/>"),
    "a tendon and no geom": model(SITE + "<body name='b'><joint name='j'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><site name='s2' pos='0 0 1'/></body>",
                                  "<tendon><spatial><site site='s'/><site site='s2'/></spatial></tendon>"),
    "a sensor of MuJoCo": model(BODY, "<sensor><accelerometer site='s'/></sensor>"),
}  # fmt: skip

ALL = ("rgb", "depth", "segmentation", "body_segmentation", "entity_segmentation", "normals", "point_cloud", "flow")
SITE_FRAME = {"frame": mjs.ObjRef("site", "s")}
SENSORS = {
    "camera": mjs.CameraSensorCfg(name="x", data_types=ALL),
    "camera with shadows": mjs.CameraSensorCfg(name="x", data_types=("rgb",), use_shadows=True, shadow_samples=4, enabled_geom_groups=(5,)),
    "camera with markers": mjs.CameraSensorCfg(name="x", data_types=ALL[:3], enabled_site_groups=(0, 1), enabled_tendon_groups=(0,), samples=4),
    "orthographic camera": mjs.CameraSensorCfg(name="x", data_types=("rgb", "depth"), orthographic=True, fovy=2),
    "camera of the model": mjs.CameraSensorCfg(name="x", camera_name="c", data_types=ALL[:3], clip_near="model"),
    "one ray": mjs.RayCastSensorCfg(name="x", pattern=mjs.UserPatternCfg(), exclude_parent_body=False, **SITE_FRAME),
    "many rays": mjs.RayCastSensorCfg(name="x", pattern=mjs.GridPatternCfg(size=(3.8, 3.8), resolution=0.1), hit_ids=True, **SITE_FRAME),
    "rays of all groups": mjs.RayCastSensorCfg(name="x", include_geom_groups=None, hit_ids=True, **SITE_FRAME),
    "rays of the world": mjs.RayCastSensorCfg(name="x", frame=mjs.ObjRef("body", "world"), exclude_parent_body=False),
    "terrain height": mjs.TerrainHeightSensorCfg(name="x", **SITE_FRAME),
    "lidar": mjs.LidarSensorCfg(name="x", **SITE_FRAME),
    "lidar with errors": mjs.LidarSensorCfg(name="x", range_noise_std=0.1, dropout=0.5, include_geom_groups=None, **SITE_FRAME),
    "contact of geoms": mjs.ContactSensorCfg(name="x", primary=mjs.ContactMatch(mode="geom", pattern=".*"), fields=("found", "force")),
    "contact of bodies": mjs.ContactSensorCfg(name="x", primary=mjs.ContactMatch(mode="body", pattern="b"), track_air_time=True),
    "imu": mjs.ImuSensorCfg(name="x", site=mjs.ObjRef("site", "s"), orientation=True),
    "joint position": mjs.BuiltinSensorCfg(name="x", sensor_type="jointpos", obj=mjs.ObjRef("joint", "j")),
    "accelerometer": mjs.BuiltinSensorCfg(name="x", sensor_type="accelerometer", obj=mjs.ObjRef("site", "s")),
    "energy": mjs.BuiltinSensorCfg(name="x", sensor_type="e_kinetic"),
}


def values_of(data):
    if isinstance(data, np.ndarray):
        return {"value": data}
    return {name: value for name in dir(data) if not name.startswith("_") and isinstance(value := getattr(data, name), np.ndarray)}


def main() -> int:
    warnings.simplefilter("ignore")
    outcomes = {"works": 0, "error": 0}
    for what, xml in MODELS.items():
        for name, sensor in SENSORS.items():
            print(f"{name} in {what}", flush=True)
            try:
                scene = mjs.Scene(mjs.SceneCfg(base=xml, sensors=(sensor,)))
                sim = mjs.Simulation(scene, num_worlds=2)
            except (KeyError, ValueError, RuntimeError) as error:
                message = str(error)
                if "\n" in message or len(message) < 15 or "'x'" not in message:
                    print("NOT A CLEAR ERROR:", message)
                    return 1
                outcomes["error"] += 1
                continue
            sim.reset()
            sim.step()
            for field, value in values_of(scene["x"].data).items():
                empty = field in ("points", "point_cloud", "flow")  # NaN where nothing is seen
                if value.dtype.kind == "f" and not empty and np.isnan(value).any():
                    print(f"NOT FINITE: {field}")
                    return 1
            sim.close()
            outcomes["works"] += 1
    print("done", outcomes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
