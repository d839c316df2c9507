# SPDX-License-Identifier: Apache-2.0
import os

# Before the first `import mujoco`: mujoco.Renderer is the reference of some tests, and there is no display.
os.environ.setdefault("MUJOCO_GL", "egl")
# Tests run programs in other directories.
if path := os.environ.get("PYTHONPATH"):
    os.environ["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, path.split(os.pathsep)))
