# SPDX-License-Identifier: Apache-2.0
"""Comparisons of simulations with ``backend="warp"`` with those on the CPU, for tools/gpu_check.py."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from warp_scenes import STATE, OfTask, SceneOfCheck

import mjsense as mjs
from mjsense.core.arrays import on_host

FORCES = ("N", "N m", "m/s^2", "rad/s^2")
"""Units of quantities that depend on the constraint solver, whose tolerance is larger than the rounding of float32."""
QUANTA = {"acc": 9.80665 / 2048, "gyro": np.radians(1) / 16.4}
"""Steps of the quantization of the IMUs of all scenes (mpu6050), m/s^2 and rad/s."""
EXACT = ("found", "found_history", "pair_found", "other_geom", "other_body", "geom_id", "body_id", "material_id", "segmentation")
"""Fields that are compared for equality although some are floats."""
UNORDERED = ("pair_", "current_", "last_", "first_")
"""Beginnings of the names of fields of contact sensors that do not depend on the order of contacts."""
DELAY_STEPS = 8
"""Number of control steps that are longer than the delay of the effect."""


@dataclass
class Bound:
    """Of the differences of a field: a share of its largest value, but at least an absolute number."""

    share: float = 0.0
    least: float = 0.0
    every: bool = False
    """True if every value must be within the bound; otherwise one in a thousand may exceed it."""


def bound_of(kind: str, key: str, unit: str, colours: bool, copied: bool) -> Bound:
    """``copied``: physics and contacts are the same on both sides, so that only the sensors' own arithmetic differs."""
    if colours:
        return Bound(least=100.0)  # textures are filtered in another way at their edges
    if kind == "camera" and key == "normals":
        return Bound(least=0.02)  # a pixel at an edge may show the other face
    if copied and kind in ("imu", "effect"):  # a value between two steps of the quantization may be rounded to either
        return Bound(1e-6, 1.001 * QUANTA.get(key, 0.0), every=True)
    if copied and kind == "builtin":
        return Bound(1e-7, every=True)  # the rounding to float32
    if copied and kind == "contact":
        return Bound(4e-6, 4e-6, every=True)  # 64 roundings to float32; see also torque_rounding
    share = 2e-2 if unit in FORCES else 5e-4 if kind == "contact" else 5e-5
    return Bound(share, share)


@dataclass
class Field:
    """Differences of one field over all scenes, sensors of its kind, worlds and steps."""

    unit: str = ""
    exact: bool = False
    limit: Bound = field(default_factory=Bound)
    rounding: float = 0.0
    """Part of the bound that does not depend on the values: for net torques the rounding of positions times the force."""
    values: int = 0
    other: int = 0
    """Number of values that are not equal (integers, bools, counts), or finite on one side only."""
    largest: float = 0.0
    difference: float = 0.0
    where: str = ""
    """Scene, world and control step of the largest difference."""
    differences: list[np.ndarray] = field(default_factory=list)

    def add(self, ours: np.ndarray, theirs: np.ndarray, rows: np.ndarray, place: str = "") -> None:
        """``rows``: the worlds whose contacts, hits and so on are the same on both sides."""
        self.values += ours.size
        if self.exact:
            self.other += int((ours != theirs).sum())
            return
        worlds = np.flatnonzero(rows)
        ours, theirs = ours[rows].astype(float), theirs[rows].astype(float)
        both = np.isfinite(ours) & np.isfinite(theirs)
        self.other += int((np.isfinite(ours) != np.isfinite(theirs)).sum())
        if both.any():
            difference = np.where(both, np.abs(np.where(both, ours, 0) - np.where(both, theirs, 0)), 0)
            self.largest = max(self.largest, float(np.abs(theirs[both]).max()))
            if difference.max() > self.difference:
                self.difference = float(difference.max())
                self.where = f"{place}, world {worlds[np.unravel_index(difference.argmax(), difference.shape)[0]]}"
            self.differences.append(np.sort(difference[both])[-max(1, difference.size // 500) :])

    def merge(self, other: Field) -> None:
        """Adds the differences of another scene."""
        self.unit, self.exact, self.limit = other.unit, other.exact, other.limit
        self.values, self.other = self.values + other.values, self.other + other.other
        self.largest, self.rounding = max(self.largest, other.largest), max(self.rounding, other.rounding)
        if other.difference > self.difference:
            self.difference, self.where = other.difference, other.where
        self.differences += other.differences

    @property
    def bound(self) -> float:
        return max(self.limit.share * self.largest, self.limit.least) + self.rounding

    def tail(self) -> float:
        """The difference that one value in a thousand exceeds."""
        found = np.sort(np.concatenate(self.differences)) if self.differences else np.zeros(1)
        return float(found[-min(len(found), max(1, self.values // 1000))])

    def exceeds(self) -> bool:
        return not self.exact and (self.difference if self.limit.every else self.tail()) > self.bound


def pair(scene: SceneOfCheck, worlds: int, device: str, reference: bool = True, decimation: int = 0) -> tuple[Any, Any]:
    """A simulation on the CPU, if it is wanted, and one on the device."""
    limits = {"nconmax": 200, "njmax": 1000} if isinstance(scene, OfTask) else {"nconmax": 100, "njmax": 400}
    if decimation:  # then it has the contacts that MuJoCo finds, of which there are more on height fields
        limits = {"nconmax": 400, "njmax": 2000}
    cfg, decimation = scene.make(), decimation or scene.decimation
    ours = mjs.Simulation(mjs.Scene(cfg), worlds, decimation, backend="warp", device=device, **limits)
    return mjs.Simulation(mjs.Scene(scene.make()), worlds, decimation) if reference else None, ours


DERIVED = tuple(
    """
    xpos xquat xmat xipos ximat geom_xpos geom_xmat site_xpos site_xmat cam_xpos cam_xmat light_xpos light_xdir subtree_com
    cvel qacc sensordata
    """.split()
)


Fields = dict[tuple[str, str], Field]


def fields() -> Fields:
    return defaultdict(Field)


class CopiedPhysics:
    """Takes the place of mujoco_warp's steps: state, derived quantities, contacts and forces are those of the worlds on the
    CPU."""

    def __init__(self, reference: Any) -> None:
        self._reference = reference

    def integrate(self, _: Any, data: Any) -> None:
        for name in STATE:
            write(getattr(data, name), getattr(self._reference, name))

    def compute_velocities(self, _: Any, data: Any) -> None:
        for name in DERIVED:
            write(getattr(data, name), getattr(self._reference.data, name))
        worlds = self._reference.env.mj_datas
        self._copy_contacts(data, worlds)
        force = np.zeros(data.efc.force.shape, np.float32)
        for world, theirs in enumerate(worlds):
            force[world, : theirs.nefc] = theirs.efc_force
        data.efc.force.assign(force)

    def compute_forces(self, *_: Any) -> None:
        """They have been copied together with the contacts."""

    @staticmethod
    def _copy_contacts(data: Any, worlds: Any) -> None:
        contacts = [theirs.contact for theirs in worlds]
        counts = [theirs.ncon for theirs in worlds]
        total = sum(counts)
        data.nacon.assign(np.array([total], np.int32))
        if not total:
            return
        for name in ("dist", "pos", "frame", "geom", "dim", "friction", "adhesion"):
            write_rows(getattr(data.contact, name), np.concatenate([getattr(c, name)[:n] for c, n in zip(contacts, counts)]))
        first = np.concatenate([c.efc_address[:n] for c, n in zip(contacts, counts)])
        offsets = np.arange(data.contact.efc_address.shape[1])
        write_rows(data.contact.efc_address, np.where(first[:, None] < 0, -1, first[:, None] + offsets))
        write_rows(data.contact.worldid, np.repeat(np.arange(len(worlds)), counts))
        write_rows(data.contact.type, np.ones(total))
        write_rows(data.contact.geomcollisionid, np.concatenate([np.arange(n) for n in counts]))


def write(array: Any, values: np.ndarray) -> None:
    array.assign(np.asarray(values, np.float32).reshape(array.numpy().shape))


def write_rows(array: Any, values: np.ndarray) -> None:
    host = array.numpy()
    host[: len(values)] = values.reshape(len(values), *host.shape[1:])
    array.assign(host)


@contextmanager
def physics_of(reference: Any) -> Iterator[None]:
    """Simulations with backend="warp" have the physics of these worlds, which have the decimation 1 and step first."""
    from mjsense.warp import physics

    copied = CopiedPhysics(reference)
    names = ("integrate", "compute_velocities", "compute_forces")
    originals = [getattr(physics, name) for name in names]
    try:
        for name in names:
            setattr(physics, name, getattr(copied, name))
        yield
    finally:
        for name, original in zip(names, originals):
            setattr(physics, name, original)


def steps(reference: Any, ours: Any, count: int, start: dict[str, np.ndarray] | None = None, seed: int = 0) -> Iterator[int]:
    """Steps both from the same states under random controls."""
    rng = np.random.default_rng(seed)
    key = "init_state" if reference.model.nkey else None
    for sim in (reference, ours):
        sim.reset(key=key)
    velocity = 0.3 * rng.normal(size=reference.qvel.shape) * (not start)
    for sim in (reference, ours):
        sim.set_state(**{"qvel": velocity, **(start or {})})
    ctrl = reference.ctrl.copy()
    for step in range(count):
        if step % 5 == 0:
            push = rng.normal(size=reference.ctrl.shape) * (0.1 if start else 0.5)
        reference.ctrl[:] = ctrl + push
        ours.ctrl = reference.ctrl
        reference.step()
        ours.step()
        ours.set_state(**{name: getattr(reference, name) for name in STATE})
        yield step


def same_contacts(reference: Any, ours: Any) -> np.ndarray:
    """The worlds in which both find the same contacts, bool ``[B]``."""
    same = np.ones(reference.num_worlds, bool)
    for name, sensor in reference.scene.sensors.items():
        if sensor.kind == "contact":
            theirs, mine = sensor.fields, ours.scene[name].fields
            for key, tolerance in {
                "found": 0.0,
                "found_history": 0.0,
                "dist": 1e-5,
                "dist_history": 1e-5,
                "normal": 1e-3,
                "normal_history": 1e-3,
            }.items():
                if key in theirs:
                    difference = np.abs(on_host(mine[key]) - theirs[key]).reshape(len(same), -1)
                    same &= (difference <= tolerance).all(1)
    return same


def contact_algorithm(model: Any) -> str:
    """Names the geoms between which mujoco_warp finds contacts in another way than MuJoCo; contact sensors are then compared in
    the worlds with the same contacts."""
    if model.nhfield:
        return ", height field"
    collides = (model.geom_contype | model.geom_conaffinity) > 0
    return ", meshes and cylinders" if np.isin(model.geom_type[collides], (4, 5, 7)).any() else ""


def compare(found: Fields, reference: Any, ours: Any, past: list[np.ndarray], place: str = "", copied: bool = False) -> None:
    """Adds the differences of all sensors at the current state.

    Args:
        past: In which worlds earlier steps had the same contacts; if copied, in which no two had equal forces.
        place: Scene and step, for the report.
        copied: The physics is the same on both sides; see :class:`CopiedPhysics`.
    """
    same = np.ones(reference.num_worlds, bool) if copied else same_contacts(reference, ours)
    past.append(~tied_contacts(reference) if copied else same)
    algorithm = "" if copied else contact_algorithm(reference.model)
    if not copied:
        add_physics(found, reference, ours, same, algorithm, place)
    delayed = same if copied else np.all(past[-DELAY_STEPS:], axis=0)
    forces = {reference.model.sensor(i).name for i in np.flatnonzero(reference.model.sensor_needstage == 3)}
    for name, sensor in reference.scene.sensors.items():
        if name not in ours.scene.sensors or sensor.kind == "contact_field":
            continue
        theirs, mine = sensor.fields, {key: on_host(value) for key, value in ours.scene[name].fields.items()}
        assert set(theirs) == set(mine), name
        rows = np.ones(len(same), bool)
        if sensor.kind in ("contact", "imu", "effect") or name in forces:
            rows = (delayed if sensor.kind == "effect" else same).copy()
        untied = np.ones(len(same), bool)
        if copied and sensor.kind == "contact" and sensor.cfg.reduce == "maxforce" and "force" in sensor.specs:
            untied = np.all(past, axis=0)  # in all steps, because the sensor may remember them
            ties = found["(contacts)", "worlds in which two have equal forces"]
            ties.exact, ties.values, ties.other = True, ties.values + len(same), ties.other + int((~untied).sum())
        for key in theirs:
            if is_exact(key, theirs[key]):
                rows &= (mine[key] == theirs[key]).reshape(len(rows), -1).all(1)
        compared = same if sensor.kind == "contact" and algorithm else np.ones(len(rows), bool)
        for key, spec in sensor.specs.items():
            assert mine[key].shape == theirs[key].shape and mine[key].dtype == theirs[key].dtype, (name, key)
            entry = found[sensor.kind, label_of(name, sensor, key)]
            entry.unit, entry.exact = spec.unit, is_exact(key, theirs[key])
            entry.limit = bound_of(sensor.kind, key, spec.unit, theirs[key].dtype == np.uint8, copied)
            if copied and key == "torque" and sensor.cfg.reduce == "netforce":
                entry.rounding = max(entry.rounding, torque_rounding(theirs["pos"], theirs["force"]))
            valid = rows if key.startswith(UNORDERED) else rows & untied
            entry.add(mine[key][compared], theirs[key][compared], valid[compared], place)


def tied_contacts(reference: Any) -> np.ndarray:
    """The worlds in which two contacts have forces that are equal within rounding to float32, bool ``[B]``: it is arbitrary which
    of them a sensor reports first. Height fields have such contacts, where two triangles meet. Contacts that are equal do not
    count."""
    tied = np.zeros(reference.num_worlds, bool)
    for world, data in enumerate(reference.env.mj_datas):
        forces = np.zeros((data.ncon, 6))
        for contact, force in enumerate(forces):
            mujoco.mj_contactForce(reference.model, data, contact, force)
        norms = np.linalg.norm(forces[:, :3], axis=1)
        order = np.argsort(norms)
        norms, places = norms[order], np.hstack([data.contact.pos, data.contact.frame])[order]
        differ = (np.abs(np.diff(places, axis=0)) > 1e-6).any(1)
        tied[world] = (differ & (np.diff(norms) < 1e-6 * norms[1:])).any()  # those without a force are equal on both sides
    return tied


def torque_rounding(pos: np.ndarray, force: np.ndarray) -> float:
    """Largest error of a net torque due to the rounding of positions to float32, N m.

    A position ``p`` is rounded by up to ``u |p|``, ``u`` = 2^-24. An arm is the difference of two positions, and so is the lever
    of the net force, a weighted mean of arms: each is wrong by up to ``2 u |p|``, and the net torque by ``4 u |p|`` times the sum
    of the forces. The contacts of one object push in similar directions, so that the net force stands for that sum.
    """
    return 4 * 2.0**-24 * float((np.linalg.norm(pos, axis=-1) * np.linalg.norm(force, axis=-1)).max())


def add_physics(found: Fields, reference: Any, ours: Any, same: np.ndarray, algorithm: str, place: str) -> None:
    """The differences of the two engines, before any sensor: in how many worlds contacts differ, and the accelerations of the
    others."""
    contacts = found["(engine)", f"worlds with other contacts{algorithm}"]
    contacts.exact, contacts.values, contacts.other = True, contacts.values + len(same), contacts.other + int((~same).sum())
    entry = found["(engine)", "qacc"]
    entry.unit, entry.limit = "m/s^2", Bound(2e-2, 2e-2)
    entry.add(on_host(ours.data.qacc), reference.data.qacc, same, place)


def is_exact(key: str, values: np.ndarray) -> bool:
    return key in EXACT or values.dtype.kind in "bi"


def label_of(name: str, sensor: Any, key: str) -> str:
    """The field in the table; for built-in sensors their type or name."""
    if sensor.kind != "builtin":
        return key
    return sensor.cfg.sensor_type if sensor.cfg else name.split("/")[-1]


def run(device: str, worlds: int, count: int, scenes: dict[str, SceneOfCheck], found: Fields | None = None) -> Fields:
    """Compares worlds that both engines step; adds to ``found``."""
    found = fields() if found is None else found
    for name, scene in scenes.items():
        reference, ours = pair(scene, worlds, device)
        past: list[np.ndarray] = []
        for step in steps(reference, ours, count, scene.start(worlds)):
            compare(found, reference, ours, past, f"{name}, step {step}")
    return found


def run_copied(device: str, worlds: int, count: int, scenes: dict[str, SceneOfCheck], found: Fields | None = None) -> Fields:
    """Compares sensors of which both sides have the same physics: that of the CPU; adds to ``found``."""
    found = fields() if found is None else found
    for name, scene in scenes.items():
        reference, ours = pair(scene, worlds, device, decimation=1)
        ours._graphs.enabled = False  # the copies come from the host
        past: list[np.ndarray] = []
        with physics_of(reference):
            for step in steps(reference, ours, count, scene.start(worlds)):
                compare(found, reference, ours, past, f"{name}, step {step}", copied=True)
    return found


def beyond(found: Fields) -> list[str]:
    """Fields of sensors that differ by more than their bound, or, if they are compared for equality, in more than 1 % of the
    values."""
    wrong = []
    for (kind, name), entry in found.items():
        if kind[0] == "(":
            continue  # the engines, not a sensor
        if entry.other > 0.01 * entry.values:
            wrong.append(f"{kind} {name}: {entry.other} of {entry.values} are not equal")
        if entry.exceeds():
            share = "one value" if entry.limit.every else "one value of 1,000"
            wrong.append(
                f"{kind} {name}: {share} differs by {entry.difference if entry.limit.every else entry.tail():.2g} {entry.unit}, "
                f"the bound is {entry.bound:.2g} ({entry.where})"
            )
    return wrong


def table(found: Fields) -> list[str]:
    """The fields that differ, and the number of those that are equal."""
    different = {key: entry for key, entry in sorted(found.items()) if entry.difference or entry.other or key[0][0] == "("}
    lines = [
        "| sensor | field | unit | largest value | largest difference | exceeded by 1 in 1,000 | bound | not equal |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for (kind, name), entry in different.items():
        share = f"{entry.other:,} of {entry.values:,}" if entry.exact or entry.other else ""
        bound = f"{entry.bound:.2g}{' (all)' if entry.limit.every else ''}"
        numbers = [""] * 4 if entry.exact else [*(f"{x:.2g}" for x in (entry.largest, entry.difference, entry.tail())), bound]
        lines.append(f"| {' | '.join([kind, name, entry.unit, *numbers, share])} |")
    return [*lines, "", f"All values of {len(found) - len(different)} other fields are equal."]


def furthest(found: Fields) -> list[str]:
    """Where the largest differences are that exceed the bound of 999 in 1,000 values."""
    return [
        f"- {kind} {name}: {entry.difference:.2g} {entry.unit} ({entry.where})"
        for (kind, name), entry in sorted(found.items())
        if not entry.exact and entry.difference > entry.bound
    ]
