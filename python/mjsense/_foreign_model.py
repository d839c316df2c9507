# SPDX-License-Identifier: Apache-2.0
"""Models of the environment's MuJoCo, of any series, for the libmujoco that mjsense uses."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from mjsense import _core, _libmujoco, _mujoco


def package_of(model: Any) -> Any:
    """The ``mujoco`` that this model belongs to; None if it is a view of mjsense. Raises TypeError for other objects."""
    if isinstance(model, _mujoco.MjModelView):
        return None
    mujoco = sys.modules.get("mujoco")  # who has a model has imported it
    if mujoco is None or not isinstance(model, mujoco.MjModel):
        raise TypeError(f"attach(): model must be a mujoco.MjModel, not {model!r:.100}")
    return mujoco


def is_our_series(mujoco: Any) -> bool:
    """Whether structs of this ``mujoco`` are laid out as in ours."""
    return mujoco is None or _libmujoco._series(mujoco.mj_versionString()) == _libmujoco.SERIES


def arrays_of(model: Any, like: Any) -> dict[str, np.ndarray]:
    """The arrays of a model in our layout, without names. `like`: a model of ours whose arrays tell the names."""
    found = {}
    for name in _FIELDS or _list_fields(like):
        value = getattr(model, name, None)
        if isinstance(value, np.ndarray):
            found[name] = value
    return found


_FIELDS: list[str] = []


def _list_fields(like: Any) -> list[str]:
    _FIELDS.extend(
        name
        for name in _core.model_fields(like._address)
        if not name.startswith("name") and name != "paths" and isinstance(getattr(like, name, None), np.ndarray)
    )
    return _FIELDS


def changed_options(model: Any, like: Any) -> list[str]:
    """The fields of ``opt`` that differ."""
    names = _core.model_fields(like._address)["opt"]
    pairs = ((name, getattr(model.opt, name, None), getattr(like.opt, name)) for name in names)
    return [name for name, now, was in pairs if now is not None and not np.array_equal(now, was)]
