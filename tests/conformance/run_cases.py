# SPDX-License-Identifier: Apache-2.0
"""run.py CASES.jsonl RESULTS.json: runs the executable cases of scene sensors through mjsense's Python API.

The scripts of the cases are mjlab's order of calls, and the expected values include the effects of its caches: contact data
change only at update() or reset(), rays and images only at sense(), and after a raw step all values are one substep old. Values
of mjsense are always current, so class Reader imitates these caches.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import traceback
from types import SimpleNamespace
from typing import Any

import numpy as np

import mjsense as mjs
from mjsense.sensors import observations
from mjsense.sensors.pipeline import ObservationPipeline

KINDS = {
    "builtin": mjs.BuiltinSensorCfg,
    "contact": mjs.ContactSensorCfg,
    "raycast": mjs.RayCastSensorCfg,
    "terrain_height": mjs.TerrainHeightSensorCfg,
    "camera": mjs.CameraSensorCfg,
}


def pattern_of(raw: dict[str, Any]) -> Any:
    raw = dict(raw)
    kind = raw.pop("kind")
    if kind == "grid":
        return mjs.GridPatternCfg(**raw)
    if kind == "ring":
        if "single_ring" in raw:
            return mjs.RingPatternCfg.single_ring(**raw.pop("single_ring"), **raw)
        raw["rings"] = tuple(mjs.RingPatternCfg.Ring(**ring) for ring in raw.get("rings", ()))
        return mjs.RingPatternCfg(**raw)
    if kind != "pinhole":
        raise ValueError(f"unknown pattern {kind!r}")
    if raw.get("from_camera") is not None:
        camera = raw["from_camera"]
        return mjs.PinholeCameraPatternCfg.from_mujoco_camera(camera["name"] if isinstance(camera, dict) else camera)
    if raw.get("from_intrinsics") is not None:
        given = raw["from_intrinsics"]
        if isinstance(given, dict):
            matrix = given.get("matrix", given.get("intrinsic_matrix", given.get("K")))
            return mjs.PinholeCameraPatternCfg.from_intrinsic_matrix(matrix, given["width"], given["height"])
        return mjs.PinholeCameraPatternCfg.from_intrinsic_matrix(given, raw["width"], raw["height"])
    return mjs.PinholeCameraPatternCfg(**raw)


def sensor_of(raw: dict[str, Any]) -> mjs.sensors.SensorCfg:
    raw = dict(raw)
    cls = KINDS[raw.pop("kind")]
    for key in ("obj", "ref"):
        if raw.get(key) is not None:
            raw[key] = mjs.ObjRef(**raw[key])
    for key in ("primary", "secondary"):
        if raw.get(key) is not None:
            raw[key] = mjs.ContactMatch(**raw[key])
    if "frame" in raw:
        frame = raw["frame"]
        raw["frame"] = tuple(mjs.ObjRef(**f) for f in frame) if isinstance(frame, list) else mjs.ObjRef(**frame)
    if "pattern" in raw:
        raw["pattern"] = pattern_of(raw["pattern"])
    return cls(**raw)


def scene_of(case: dict[str, Any]) -> mjs.Scene:
    raw = case["scene"]
    terrain = raw.get("terrain")
    return mjs.Scene(
        mjs.SceneCfg(
            num_envs=raw.get("num_envs", 1),
            env_spacing=raw.get("env_spacing", 2.0),
            terrain=mjs.TerrainCfg(terrain) if isinstance(terrain, str) else mjs.TerrainCfg(**terrain) if terrain else None,
            entities={entity["name"]: mjs.EntityCfg(model=entity["mjcf"]) for entity in raw.get("entities", ())},
            sensors=tuple(sensor_of(s) for s in case.get("sensors", ())),
            options=mjs.MujocoCfg(**(raw.get("options") or {})),
        )
    )


class Reader:
    """Imitates mjlab's caches for sensors whose values are always current."""

    def __init__(self, sim: mjs.Simulation) -> None:
        self.sim = sim
        self.cache: dict[str, Any] = {}
        self.sensed = False

    def traced(self, sensor: Any) -> bool:
        return isinstance(sensor, (mjs.sensors.RayCastSensor, mjs.sensors.CameraSensor))

    def read(self, key: str) -> Any:
        sensor = self.sim.scene[key]
        if isinstance(sensor, mjs.sensors.ContactSensor):
            if key not in self.cache:
                self.cache[key] = copy_of(sensor.data)
            return self.cache[key]
        if self.traced(sensor):
            if key not in self.cache:
                self.cache[key] = copy_of(sensor.data)
                if not self.sensed:
                    for name, array in fields_of(self.cache[key]).items():
                        array[...] = 0
            return self.cache[key]
        return sensor.data

    def drop(self, traced: bool) -> None:
        for key in list(self.cache):
            if self.traced(self.sim.scene[key]) == traced:
                del self.cache[key]

    def sense(self) -> None:
        self.sensed = True
        self.drop(traced=True)
        for key, sensor in self.sim.scene.sensors.items():
            if self.traced(sensor):
                self.read(key)

    def hold(self, key: str) -> Any:
        """A function that returns the later contents of the object that mjlab returns now: some of its arrays are updated in
        place."""
        sensor = self.sim.scene[key]
        held = self.read(key)
        if isinstance(sensor, mjs.sensors.BuiltinSensor):
            return lambda: sensor.data
        held = copy_of(held)
        live: tuple[str, ...] = ()
        if isinstance(sensor, mjs.sensors.ContactSensor):
            live = ("current_air_time", "last_air_time", "current_contact_time", "last_contact_time")
        elif isinstance(sensor, mjs.sensors.CameraSensor):
            live = () if sensor_clones(self.sim.scene, key) else ("rgb", "depth", "segmentation")
        elif self.traced(sensor):
            live = ("distances", "normals_w")

        def later() -> Any:
            now = sensor.data if isinstance(sensor, mjs.sensors.ContactSensor) else self.read(key)
            for name in live:
                if getattr(held, name, None) is not None:
                    setattr(held, name, np.array(getattr(now, name)))
            return held

        return later


def sensor_clones(scene: mjs.Scene, key: str) -> bool:
    return any(getattr(cfg, "clone_data", False) for cfg in scene.cfg.sensors if cfg.prefixed_name == key)


def fields_of(value: Any) -> dict[str, np.ndarray]:
    if isinstance(value, np.ndarray):
        return {"data": value}
    return {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if getattr(value, f.name) is not None}


def copy_of(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    return dataclasses.replace(value, **{name: array.copy() for name, array in fields_of(value).items()})


def encode(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "v": value.ravel().tolist()}
    if isinstance(value, np.generic):
        return value.item()
    return list(value) if isinstance(value, tuple) else value


def result_of(value: Any) -> dict[str, Any]:
    """A sensor's value as {field: array}."""
    return {name: encode(array) for name, array in fields_of(value).items()}


def set_state(sim: mjs.Simulation, op: dict[str, Any]) -> None:
    for name in ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "qfrc_applied", "xfrc_applied"):
        if op.get(name) is not None:
            view = getattr(sim, name)
            value = np.asarray(op[name], dtype=float)
            if value.size == view.size:
                value = value.reshape(view.shape)
            elif value.size == view[0].size:
                value = value.reshape(view.shape[1:])
            sim.set_state(forward=False, **{name: value})


def run_script(case: dict[str, Any]) -> dict[str, Any]:
    scene = scene_of(case)
    sim = mjs.Simulation(scene, threads=1)
    reader = Reader(sim)
    env = SimpleNamespace(scene=ReaderScene(reader), num_envs=sim.num_worlds)
    held: dict[str, Any] = {}
    out: dict[str, Any] = {}
    for op in case["script"]:
        match op["op"]:
            case "state":
                set_state(sim, op)
            case "forward":
                sim.forward()
            case "step":
                sim.step_raw(op.get("n", 1))
            case "update":
                for _ in range(op.get("n", 1)):
                    sim.update_sensors(op.get("dt", 0.0))
                reader.drop(traced=False)
            case "step_update":
                for _ in range(op.get("n", 1)):
                    sim.step_raw(1)
                    sim.update_sensors(op.get("dt", 0.0))
                reader.drop(traced=False)
            case "sense":
                reader.sense()
            case "reset_sensors":
                sim.reset_sensors(op.get("envs"))
                reader.drop(traced=False)
            case "read":
                out[op["as"]] = result_of(reader.read(op["sensor"]))
            case "hold":
                held[op["as"]] = reader.hold(op["sensor"])
            case "read_held":
                out[op["as"]] = result_of(held[op.get("held", op.get("from", op["as"]))]())
            case "call":
                value = getattr(scene[op["sensor"]], op["method"])(**op.get("args", {}))
                out[op["as"]] = {"value": encode(value)}
            case "attr":
                out[op["as"]] = {"value": encode(getattr(scene[op["sensor"]], op["attr"]))}
            case "sensor_names":
                out[op["as"]] = {"value": list(scene.sensors)}
            case "names":
                out[op["as"]] = {"value": names_of(scene, op["type"])}
            case "env_origins":
                out[op["as"]] = {"value": encode(scene.env_origins(sim.num_worlds))}
            case "keyframe":
                out[op["as"]] = keyframe_of(scene, op)
            case "obs":
                value = getattr(observations, op["func"])(env, **op.get("params", {}))
                out[op["as"]] = {"data": encode(np.asarray(value))}
            case unknown:
                raise ValueError(f"unknown op {unknown!r}")
    return out


class ReaderScene:
    """A scene for observation functions whose sensors return the values of the reader."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader

    def __getitem__(self, key: str) -> Any:
        sensor = self.reader.sim.scene[key]
        cfg = next((c for c in self.reader.sim.scene.cfg.sensors if c.prefixed_name == key), None)
        return SimpleNamespace(data=self.reader.read(key), cfg=cfg, name=sensor.name)


def names_of(scene: mjs.Scene, kind: str) -> list[str]:
    model = scene.model
    count, at = {
        "body": (model.nbody, model.body),
        "geom": (model.ngeom, model.geom),
        "site": (model.nsite, model.site),
        "joint": (model.njnt, model.joint),
        "actuator": (model.nu, model.actuator),
        "tendon": (model.ntendon, model.tendon),
        "camera": (model.ncam, model.camera),
        "sensor": (model.nsensor, model.sensor),
        "key": (model.nkey, model.key),
    }[kind]
    return [at(i).name for i in range(count)]


def keyframe_of(scene: mjs.Scene, op: dict[str, Any]) -> dict[str, Any]:
    key = scene.model.key(op.get("name", "init_state"))
    return {name: encode(np.array(getattr(key, name), dtype=np.float32)) for name in ("qpos", "qvel", "ctrl")}


def run_case(case: dict[str, Any]) -> dict[str, Any]:
    if "pattern_only" in case:
        offsets, directions = pattern_of(case["pattern_only"]).generate_rays()
        return {"rays": {"offsets": encode(offsets), "directions": encode(directions)}}
    if "pipeline" in case:
        settings = dict(case["pipeline"])
        frames = np.asarray(settings.pop("frames"), dtype=np.float32)
        if "delay" in settings:  # constant delay
            settings["delay_min_lag"] = settings["delay_max_lag"] = settings.pop("delay")
        pipeline = ObservationPipeline(num_worlds=frames.shape[1], **settings)
        return {"out": {"data": encode(np.stack([pipeline(frame) for frame in frames]))}}
    return run_script(case)


def main(cases: str, results: str) -> int:
    out = {}
    with open(cases) as lines:
        for line in filter(str.strip, lines):
            case = json.loads(line)
            try:
                out[case["id"]] = {"ok": run_case(case)}
            except Exception as error:
                out[case["id"]] = {
                    "err": {"type": type(error).__name__, "msg": str(error), "trace": traceback.format_exc(limit=-3)}
                }
    with open(results, "w") as file:
        json.dump(out, file)
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
