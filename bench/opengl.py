# SPDX-License-Identifier: Apache-2.0
"""Makes MuJoCo's classic renderer usable. To be imported before mujoco, which looks for PyOpenGL once, when it is imported itself."""

import importlib.util
import os
import sys

from fetch import Unavailable, wheel

os.environ.setdefault("MUJOCO_GL", "egl")
if importlib.util.find_spec("OpenGL") is None:
    try:
        sys.path.append(str(wheel("PyOpenGL")))
    except Unavailable as error:
        sys.exit(str(error))
