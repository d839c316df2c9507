#!/bin/sh
# What a newcomer does first, with nothing in PATH but the Python of a fresh environment: packaging/try.sh and minimal.sh run it there.
# usage: newcomer.sh ENVIRONMENT
set -eu
cd "$1"
PATH=$1/bin
export PATH
python - <<'EOF'
import time
start = time.perf_counter(), time.process_time()
import mjsense as mjs
imported = time.perf_counter(), time.process_time()
scene = mjs.Scene(mjs.SceneCfg(
    entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")}, terrain=mjs.TerrainCfg(), sensors=(
        mjs.BuiltinSensorCfg(name="acc", sensor_type="accelerometer", obj=mjs.ObjRef(type="site", name="imu", entity="robot")),
        mjs.ContactSensorCfg(name="feet", primary=mjs.ContactMatch(mode="geom", pattern=".*_foot", entity="robot"), track_air_time=True),
        mjs.RayCastSensorCfg(name="scan", frame=mjs.ObjRef(type="body", name="trunk", entity="robot"), ray_alignment="yaw",
                             pattern=mjs.GridPatternCfg(size=(1.6, 1.0), resolution=0.1)))))
sim = mjs.Simulation(scene, num_worlds=64, decimation=4)
sim.reset(seed=0, key="init_state")
sim.step()
shape = scene["scan"].data.distances.shape
stepped = time.perf_counter(), time.process_time()
print(f"import {imported[0] - start[0]:.2f} s ({imported[1] - start[1]:.2f} s CPU); "
      f"64 quadrupeds, first step and {shape[1]} rays each: {stepped[0] - imported[0]:.2f} s ({stepped[1] - imported[1]:.2f} s CPU)")
EOF
mjsense --version
mjsense record pick --episodes 2 --worlds 2 --size 64x48 --out data --quiet
mjsense verify --decode data
python - <<'EOF'
import pathlib, h5py
import mjsense  # beside it, an HDF5 of its own
file = next(pathlib.Path("data").rglob("*.h5"))
with h5py.File(file) as house:
    for name, episode in house.items():
        if isinstance(episode, h5py.Group) and "actions" in episode:
            print(name, *sorted(episode), sep=" ")
print(*sorted(path.name for path in pathlib.Path("data").rglob("*.mp4"))[:3])
EOF
