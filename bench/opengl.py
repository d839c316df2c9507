# SPDX-License-Identifier: Apache-2.0
"""Makes MuJoCo's classic renderer usable: selects EGL and finds PyOpenGL. Import it before mujoco, which looks for PyOpenGL at
its import."""

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
