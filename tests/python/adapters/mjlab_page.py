# SPDX-License-Identifier: Apache-2.0
"""Runs the first code block of docs/mjlab.md with mjlab itself and with mjsense; compares what the sensors read and the CPU time of a step.

python mjlab_page.py PAGE [WORLDS] [PICTURE]
"""

import re
import sys
import time
from pathlib import Path

import numpy as np

page = Path(sys.argv[1]).read_text()
worlds = sys.argv[2] if len(sys.argv) > 2 else "4"
after = re.search(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[1].replace("num_envs=4", f"num_envs={worlds}")
before = after.replace("mjsense.compat.mjlab", "mjlab")
assert "mjsense" in after
assert "mjsense" not in before

found, times = [], []
for code in (before, after):
    names = {}
    exec(code, names)
    scene, sim = names["scene"], names["sim"]
    eye, feet, scan = (scene[name].data for name in ("eye", "feet_ground_contact", "terrain_scan"))
    found.append([np.array(x) for x in (scan.distances, feet.force, feet.current_air_time, eye.depth, eye.rgb)])

    def run(steps, image, scene=scene, sim=sim):
        start = time.process_time()
        for _ in range(steps):
            for _ in range(4):
                sim.step()
                scene.update(dt=0.005)
            sim.forward()
            sim.sense()
            scene["terrain_scan"].data, scene["feet_ground_contact"].data
            if image:
                scene["eye"].data
        return 1e3 * (time.process_time() - start) / steps

    times.append((run(3, True), run(20, True)))
(rays, force, air, depth, rgb), (our_rays, our_force, our_air, our_depth, our_rgb) = found
error = np.abs(depth - our_depth)
print(f"largest differences: rays {np.abs(rays - our_rays).max():.1e} m, forces {np.abs(force - our_force).max():.1e} of {np.abs(force).max():.1f} N, "
      f"air time {np.abs(air - our_air).max():.1e} s; depth: median {np.median(error):.1e} m")  # fmt: skip
print(f"CPU time of 4 physics steps and all sensors, {worlds} worlds: mjlab {times[0][1]:.1f} ms, mjsense {times[1][1]:.2f} ms")
if len(sys.argv) > 3:
    from mjsense.core.png import png_of

    Path(sys.argv[3]).write_bytes(png_of(np.concatenate((rgb[0], our_rgb[0]), 1)))
np.testing.assert_allclose(our_rays, rays, atol=1e-5)
np.testing.assert_allclose(our_force, force, atol=2e-3 * max(1, np.abs(force).max()))
np.testing.assert_allclose(our_air, air, atol=1e-6)
assert np.median(error) < 1e-5
assert np.abs(force).max() > 10
assert rgb.shape == our_rgb.shape
assert our_rgb.std() > 10
