# SPDX-License-Identifier: Apache-2.0
"""States of a model from recorded positions of its joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import read_text
from mjsense.dataset import foreign_values as foreign
from mjsense.dataset.import_rows import archive_of, compile_archive, unique_name
from mjsense.dataset.lerobot_reader import STATE, LeRobotReader
from mjsense.dataset.model_fields import MAX_STATE

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = libmujoco.shared


class JointPoses:
    """States of a model from the positions of its joints."""

    def __init__(self, scene: Path, source: LeRobotReader, joints: Sequence[str] | None) -> None:
        if mujoco is None:
            raise RuntimeError(f"scene needs the series of MuJoCo that mjsense uses: {libmujoco.explain()}")
        read_text(scene)
        try:
            spec = mujoco.MjSpec.from_file(str(scene))
            spec.compile()
        except ValueError as error:
            raise ValueError(f"scene: MuJoCo cannot load {scene}: {error}") from None

        def read(file: str, folder: str) -> tuple[str, bytes]:
            path = next(
                (path for path in (scene.parent / folder / file, scene.parent / file, Path(file)) if path.is_file()), None
            )
            if path is None:
                raise FileNotFoundError(f"scene: {scene} names {file}, which does not exist")
            content = path.read_bytes()
            return unique_name(file, content), content

        self.archive = archive_of(spec.to_xml(), read, str(scene))
        self.model = compile_archive(self.archive[1], str(scene))
        self._data = mujoco.MjData(self.model)
        if STATE not in source.numbers:
            raise ValueError(f"{source.root} has no {STATE}, which scene needs")
        feature = source.features[STATE]
        names = list(joints) if joints is not None else feature.names
        size = math.prod(feature.shape)
        scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        known = {
            self.model.joint(i).name: int(self.model.jnt_qposadr[i])
            for i in range(self.model.njnt)
            if self.model.jnt_type[i] in scalar
        }
        if len(names) != size:
            raise ValueError(f"joints names {counted(len(names), 'joint')}, but {STATE} has {counted(size, 'number')}")
        if unknown := [name for name in names if name and name not in known]:
            raise UnknownNameError(
                f"{scene} has no hinge or slide joint '{unknown[0]}', the name of a number of {STATE}; joints "
                "(--joints) gives others, "
                f"of {', '.join(known)}"
            )
        self._from = [i for i, name in enumerate(names) if name]
        self._to = [known[names[i]] for i in self._from]

    def state(self, values: np.ndarray, time: float, about: str) -> np.ndarray:
        """MuJoCo's state with these numbers of ``observation.state``."""
        if not np.all(np.abs(values) <= MAX_STATE):
            raise ValueError(f"{about}: {STATE} is {foreign.found(values.tolist())}, expected numbers of at most {MAX_STATE:g}")
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        self._data.time = time
        self._data.qpos[self._to] = values.ravel()[self._from]
        mujoco.mj_getState(self.model, self._data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state
