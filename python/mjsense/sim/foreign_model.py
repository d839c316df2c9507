# SPDX-License-Identifier: Apache-2.0
"""Models of the environment's MuJoCo, of any series, for the libmujoco that mjsense uses.

A model of another series is copied array by array. Fields that the other series does not have get the value that means what was
always so there, or are computed from fields that it has. Fields of an unknown name or shape are refused.
"""

from __future__ import annotations

import sys
from itertools import product
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core import libmujoco, mujoco_views
from mjsense.core.spec_views import RENUMBERED

_ENUMS = {"actuator_dyntype": "mjtDyn", "actuator_gaintype": "mjtGain", "actuator_biastype": "mjtBias", "eq_type": "mjtEq"}
"""Arrays whose numbers differ between series, with their enumerations."""

_NEW_SENSORS = {"mjSENS_TENDONACTFRC": 17, "mjSENS_INSIDESITE": 38, "mjSENS_CONTACT": 42, "mjSENS_TACTILE": 46}
"""Types of sensors that were inserted after 3.3.0, with their numbers; those of the types after them were smaller before."""

_DEFAULTS: dict[str, Any] = {
    "actuator_ctrlnum": 1,
    "actuator_outnum": 1,
    "actuator_historyadr": -1,
    "cam_output": 1,
    "dof_length": 1.0,
    "geom_castshadow": True,
    "jnt_actuatorid": -1,
    "jnt_plasticadr": -1,
    "light_softness": 0.2,
    "light_texid": -1,
    "sensor_historyadr": -1,
    "site_dataid": -1,
    "tendon_actuatorid": -1,
    "tendon_plasticadr": -1,
    "tex_contenttypeadr": -1,
}
"""Values of fields that older series lack; all others are 0."""

_GONE = ("flex", "cam_orthographic", "light_directional")
"""Beginnings of the names of arrays that only older series have. Models with flexes are refused; the content of the others is in
new fields."""


def package_of(model: Any) -> Any:
    """The ``mujoco`` that this model belongs to; None if it is a view of mjsense. Raises TypeError for other objects."""
    if isinstance(model, mujoco_views.MjModelView):
        return None
    mujoco = sys.modules.get("mujoco")  # who has a model has imported it
    if mujoco is None or not isinstance(model, mujoco.MjModel):
        raise TypeError(f"attach(): model must be a mujoco.MjModel, not {model!r:.100}")
    return mujoco


def is_our_series(mujoco: Any) -> bool:
    """Whether structs of this ``mujoco`` are laid out as in ours."""
    return mujoco is None or libmujoco._series(mujoco.mj_versionString()) == libmujoco.SERIES


def values_of(model: Any, like: Any) -> dict[str, np.ndarray]:
    """The arrays of a model, without names, and its options, as ``opt.gravity``; `like` has all fields of mjsense's MuJoCo."""
    fields = _core.model_fields(like._address)
    names = [
        name for name, place in fields.items() if isinstance(place, tuple) and place[2] != () and not name.startswith("name")
    ]
    arrays = {name: value for name in names if isinstance(value := getattr(model, name, None), np.ndarray)}
    options = {
        f"opt.{name}": np.atleast_1d(np.array(getattr(model.opt, name), kind)) for name, (_, kind, _) in fields["opt"].items()
    }
    return {**arrays, **options}


def copy_of(model: Any) -> Any:
    """A copy of a model of another series; raises ValueError if it has something that cannot be copied."""
    mujoco = package_of(model)
    version = mujoco.mj_versionString()
    for size, what in (("nflex", "flexes"), ("nplugin", "plugins"), ("nhistory", "histories of sensors or actuators")):
        if getattr(model, size, 0):
            raise ValueError(
                f"attach(): the model has {what}, which cannot be attached from MuJoCo {version}: they need "
                f"{libmujoco.REQUIREMENT}"
            )
    view = mujoco_views.MjModelView(_core.OwnedModel.take(_core.make_model(_sizes(model))))
    _refuse_unknown(model, view, version)
    for name, place in _core.model_fields(view._address).items():
        if isinstance(place, dict) or name in ("names", "paths", "text_data") or (place[2] == () and not name.startswith("flg_")):
            continue
        target, source = view._get(name), getattr(model, name, None)
        if source is None:
            target[...] = _DEFAULTS.get(name, 0)
        elif name == "eq_data":
            target[:, : source.shape[1]] = source
            if source.shape[1] == 11:
                target[model.eq_type == 1, 11] = 1  # of welds
        elif target.size != np.size(source):
            raise ValueError(f"attach(): {name} of MuJoCo {version} has the shape {np.shape(source)}, expected {target.shape}")
        else:
            target[...] = np.reshape(source, target.shape)
    for name in ("names", "paths", "text_data"):
        if view._get(name).size:
            view._get(name)[...] = np.frombuffer(getattr(model, name), view._get(name).dtype)
    for name, enum in _ENUMS.items():
        values, members = getattr(model, name), getattr(mujoco, enum).__members__
        for member, number in RENUMBERED.items():
            if member in members:
                view._get(name)[values == int(members[member])] = number
    for member, number in _NEW_SENSORS.items():
        if not hasattr(mujoco.mjtSensor, member):
            view.sensor_type[view.sensor_type >= number] += 1
    _compute(view, model)
    _copy_structs(view, model, mujoco)
    return view


def _refuse_unknown(model: Any, view: Any, version: str) -> None:
    """Raises ValueError if the model has an array with values that mean nothing here."""
    for name in dir(model):
        if name[0] != "_" and name not in view._fields and not name.startswith(_GONE):
            value = getattr(model, name, None)
            if isinstance(value, np.ndarray) and value.any():
                raise ValueError(
                    f"attach(): the model of MuJoCo {version} has {name}, which mjsense's MuJoCo "
                    f"{'.'.join(map(str, libmujoco.SERIES))} does not know"
                )


def _sizes(model: Any) -> dict[str, int]:
    names = [
        name
        for name, place in _core.model_fields(
            _core.OwnedModel.take(_core.make_model({"nbody": 1, "nnames_map": 2})).address
        ).items()
        if isinstance(place, tuple) and place[2] == () and name.startswith("n")
    ]
    sizes = {name: int(getattr(model, name)) for name in names if hasattr(model, name)}
    new = {"nactuator": model.nu, "nout": model.nu}
    if not hasattr(model, "nJten"):
        new["nJten"] = int(sum(len(dofs) for dofs in _tendon_dofs(model)))
    for name, of in (("npolygonmax", "mesh_polyvertnum"), ("nmeshdegmax", "mesh_polymapnum")):
        new[name] = int(max(getattr(model, of), default=0))
    return {**new, **sizes}


def _tendon_dofs(model: Any) -> list[list[int]]:
    """The degrees of freedom that each tendon depends on, by its path."""
    joint, site, first_geom = 1, 3, 4  # mjtWrap
    found = []
    for tendon in range(model.ntendon):
        dofs: set[int] = set()
        for wrap in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
            kind, element = model.wrap_type[wrap], model.wrap_objid[wrap]
            if kind == joint:
                dofs.add(int(model.jnt_dofadr[element]))
            elif kind == site or kind >= first_geom:
                body = (model.site_bodyid if kind == site else model.geom_bodyid)[element]
                while body:
                    first = int(model.body_dofadr[body])
                    dofs.update(range(first, first + int(model.body_dofnum[body])) if first >= 0 else ())
                    body = model.body_parentid[body]
        found.append(sorted(dofs))
    return found


def _sparse_matrices(model: Any) -> dict[str, np.ndarray]:
    """The structure of the model's sparse matrices, which models have from 3.3.6 on.

    M is the lower triangle of the inertia matrix without the zeros of simple degrees of freedom, D the whole matrix with them. B
    has the degrees of freedom of each body, its ancestors and its descendants.
    """

    def chain(start: int, parents: np.ndarray, root: int) -> list[int]:
        """`start` after all that it depends on."""
        found = []
        while start > root:
            found.append(int(start))
            start = parents[start]
        return found[::-1]

    chains = [chain(dof, model.dof_parentid, -1) for dof in range(model.nv)]
    of_m = [[dof] if model.dof_simplenum[dof] else chains[dof] for dof in range(model.nv)]
    of_d = [row + [below for below in range(dof + 1, model.nv) if dof in chains[below]] for dof, row in enumerate(chains)]
    lines = [{0, *chain(body, model.body_parentid, 0)} for body in range(model.nbody)]
    of_b = [[i for i, at in enumerate(model.dof_bodyid) if at in lines[body] or body in lines[at]] for body in range(model.nbody)]
    out: dict[str, Any] = {"D_diag": [len(row) - 1 for row in chains]}
    for name, rows in (("M", of_m), ("D", of_d), ("B", of_b)):
        out[f"{name}_rownnz"] = [len(row) for row in rows]
        out[f"{name}_rowadr"] = np.cumsum([0, *out[f"{name}_rownnz"]])[:-1]
        out[f"{name}_colind"] = [dof for row in rows for dof in row]
    in_m = {(i, j): out["M_rowadr"][i] + k for i, row in enumerate(of_m) for k, j in enumerate(row)}
    out["mapM2D"] = [in_m.get((max(i, j), min(i, j)), -1) for i, row in enumerate(of_d) for j in row]
    out["mapD2M"] = [out["D_rowadr"][i] + of_d[i].index(j) for i, j in in_m]
    out["mapM2M"] = [model.dof_Madr[i] + len(row) - 1 - k for i, row in enumerate(of_m) for k in range(len(row))]
    return {name: np.array(value, int) for name, value in out.items()}


def _compute(view: Any, model: Any) -> None:
    """Fields that older series lack and that follow from others."""
    missing = {name for name in view._fields if not hasattr(model, name)}

    def put(name: str, value: Any) -> None:
        if name in missing:
            view._get(name)[...] = value

    put("actuator_ctrladr", np.arange(model.nu))
    put("actuator_outadr", np.arange(model.nu))
    put("flg_gravcomp", bool(np.any(model.body_gravcomp)))
    if "cam_projection" in missing:
        put("cam_projection", model.cam_orthographic)
    if "M_rownnz" in missing:
        for name, value in _sparse_matrices(model).items():
            view._get(name)[...] = value
    if "light_type" in missing:
        put("light_type", model.light_directional)  # mjLIGHT_DIRECTIONAL is 1
    if "mesh_extrema" in missing:
        directions = np.array(list(product((-1, 0, 1), repeat=3)), float)
        for mesh in np.flatnonzero(model.mesh_graphadr >= 0):
            graph = model.mesh_graph[model.mesh_graphadr[mesh] :]
            hull = graph[2 + graph[0] : 2 + 2 * graph[0]] + model.mesh_vertadr[mesh]
            view.mesh_extrema[mesh] = np.argmax(directions @ model.mesh_vert[hull].T.astype(float), axis=1)
    if "tree_bodyadr" in missing:
        for tree in range(model.ntree):
            bodies, dofs = np.flatnonzero(model.body_treeid == tree), np.flatnonzero(model.dof_treeid == tree)
            view.tree_bodyadr[tree], view.tree_bodynum[tree] = bodies[0], len(bodies)
            view.tree_dofadr[tree], view.tree_dofnum[tree] = dofs[0], len(dofs)
    if model.ntendon:
        put("tendon_type", model.wrap_type[model.tendon_adr] != 1)
    if "tendon_treeid" in missing:
        for tendon, dofs in enumerate(_tendon_dofs(model)):
            trees = np.unique(model.dof_treeid[dofs])
            view.tendon_treenum[tendon], view.tendon_treeid[tendon] = len(trees), (*trees[:2], -1, -1)[:2]
    if "cam_output" in missing:  # the first series without a choice of what a rangefinder measures
        distances = model.sensor_type == 7
        view.sensor_intprm[distances, 0], view.sensor_datatype[distances] = 1, 0
    for body in range(1, model.nbody):  # some series weld mocap bodies to the world
        parent = model.body_parentid[body]
        if model.body_weldid[body] == 0:
            view.body_weldid[body] = body if model.body_mocapid[body] >= 0 else view.body_weldid[parent]
    if "ten_J_rownnz" in missing:
        start = 0
        for tendon, dofs in enumerate(_tendon_dofs(model)):
            view.ten_J_rownnz[tendon], view.ten_J_rowadr[tendon] = len(dofs), start
            view.ten_J_colind[start : start + len(dofs)] = dofs
            start += len(dofs)


def _copy_structs(view: Any, model: Any, mujoco: Any) -> None:
    pairs = [(view.opt, model.opt), (view.stat, model.stat)]
    pairs += [
        (getattr(view.vis, group), getattr(model.vis, group, None) or getattr(model.vis, f"{group}_", None))
        for group in view.vis._fields
    ]
    for to, from_ in pairs:
        for name in to._fields:
            value = getattr(from_, name, None)
            if value is not None and np.shape(value) == np.shape(
                getattr(to, name)
            ):  # some of MuJoCo's bindings of colours are empty
                setattr(to, name, value)
    multiccd = getattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD", None)
    if multiccd is not None:  # now a flag that disables
        enabled = view.opt.enableflags & int(multiccd)
        view.opt.enableflags &= ~int(multiccd)
        view.opt.disableflags |= 0 if enabled else 1 << 19
