# SPDX-License-Identifier: Apache-2.0
import os

# Before the first `import mujoco`: mujoco.Renderer is the reference of some tests, and there is no display.
os.environ.setdefault("MUJOCO_GL", "egl")
