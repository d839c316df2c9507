# SPDX-License-Identifier: Apache-2.0
"""Runs mink's examples with mjsense.Renderer in place of the viewer, and compares its images with those of mujoco.Renderer.

    python mink_examples.py CHECKOUT

CHECKOUT is a folder with mink's repository. Each example runs for STEPS steps of its loop. Examples whose models this MuJoCo cannot load, or of which files are missing, are listed.
"""

import runpy
import sys
from pathlib import Path

from images import end, require_opengl

require_opengl()
import loop_rate_limiters
import mujoco
import mujoco.viewer
from compared import Compared

STEPS = 3
WORST = 24  # dB, of the scene of ALOHA


class Viewer:
    """Has what the examples use of the handle of launch_passive()."""

    def __init__(self, model, data, **_):
        self.data, self.cam, self.opt, self.steps = data, mujoco.MjvCamera(), mujoco.MjvOption(), 0
        mujoco.mjv_defaultFreeCamera(model, self.cam)
        self.renderer = Compared(model, 120, 160)

    def is_running(self):
        self.steps += 1
        return self.steps <= STEPS

    def sync(self):
        self.renderer.update_scene(self.data, self.cam, self.opt)
        self.renderer.render()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.renderer.close()


mujoco.viewer.launch_passive = Viewer
loop_rate_limiters.RateLimiter.sleep = lambda self: None
examples = sorted(Path(sys.argv[1], "examples").glob("*.py"))
played = 0
for example in examples:
    Compared.cell = example.stem
    sys.path.insert(0, str(example.parent))
    try:
        runpy.run_path(str(example), run_name="__main__")
    except (ValueError, FileNotFoundError) as error:
        if not isinstance(error, FileNotFoundError) and not str(error).startswith("Error"):
            raise
        print(f"{example.stem}: left out: {str(error)[-150:]}")
        continue
    finally:
        sys.path.remove(str(example.parent))
    played += 1
    print(f"{example.stem}: {Compared.worst[example.stem]:.1f} dB", flush=True)
assert played >= len(examples) // 2, f"{played} of {len(examples)} examples"
assert min(Compared.worst.values()) >= WORST
end()
