# SPDX-License-Identifier: Apache-2.0
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
# Before `import mujoco`: mujoco.Renderer is the reference of some tests, and there is no display.
os.environ.setdefault("MUJOCO_GL", "egl")
