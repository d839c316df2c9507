"""mjsense: batched sensors for MuJoCo, from the simulator to the policy to the disk."""

import mujoco as _mujoco  # first: it loads the libmujoco that the extension shares

if _mujoco.mj_versionString() != "4.0.1":
    raise ImportError(
        f"mjsense needs MuJoCo 4.0.1, found {_mujoco.mj_versionString()}: pip install 'mujoco-core==4.0.1'"
    )

from mjsense import _core
from mjsense._core import SensorSpec, __version__
from mjsense.errors import UnknownNameError
