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
# Every kind of CPU that Embree is compiled for, up to this one. On AArch64 there is one.
case $(python -c 'import platform; print(platform.machine())') in
  x86_64) options="max_isa=sse2 max_isa=avx2 max_isa=avx512" ;;
  *) options="verbose=0" ;;
esac
for option in $options; do
  MJSENSE_EMBREE=$option python - <<'EOF'
import os
import mjsense as mjs
# A wall of triangles at 2 m, between a lamp and a plate.
model = '''<mujoco><asset><mesh name="wall" vertex="2 -1 -1  2 1 -1  2 -1 1  2 1 1  3 -1 -1  3 1 -1  3 -1 1  3 1 1"/></asset>
  <worldbody><light pos="2.5 0 5" dir="0 0 -1" castshadow="true"/><geom type="mesh" mesh="wall"/><geom type="box" pos="2.5 0 -2" size="2 2 .1"/>
  <body name="eye"><geom size=".01"/><camera name="view" pos="-2 0 0" xyaxes="0 -1 0 0 0 1"/></body></worldbody></mujoco>'''
sensors = [mjs.RayCastSensorCfg(name="ahead", frame=mjs.ObjRef(type="body", name="eye", entity="room"),
                                pattern=mjs.GridPatternCfg(size=(0.0, 0.0), resolution=1.0, direction=(1.0, 0.0, 0.0)))]
sensors += [mjs.CameraSensorCfg(name=name, camera_name="room/view", width=64, height=64, use_shadows=name == "lit") for name in ("lit", "plain")]
scene = mjs.Scene(mjs.SceneCfg(entities={"room": mjs.EntityCfg(model=model)}, sensors=sensors))
sim = mjs.Simulation(scene)
sim.forward()
distance = float(scene["ahead"].data.distances[0, 0])
darker = (scene["lit"].data.rgb.sum(-1) < scene["plain"].data.rgb.sum(-1)).mean()
print(f"Embree with {os.environ['MJSENSE_EMBREE']}: a wall of triangles at {distance:.3f} m, its shadow on {darker:.0%} of a picture")
assert abs(distance - 2) < 1e-4 and darker > 0.01
EOF
done
mjsense --version
mjsense record pick --episodes 2 --worlds 2 --size 64x48 --out data --quiet
mjsense record pick --episodes 2 --worlds 2 --cameras none --out blind --quiet
mjsense verify --decode data
mjsense verify blind
mjsense replay --verify data --quiet
mjsense replay --verify blind --quiet
python - <<'EOF'
import pathlib, h5py
import mjsense  # contains a second HDF5 library
file = next(pathlib.Path("data").rglob("*.h5"))
with h5py.File(file) as house:
    for name, episode in house.items():
        if isinstance(episode, h5py.Group) and "actions" in episode:
            print(name, *sorted(episode), sep=" ")
print(*sorted(path.name for path in pathlib.Path("data").rglob("*.mp4"))[:3])
EOF
