# SPDX-License-Identifier: Apache-2.0
"""What an untrusted model would allocate, counted from its MJCF before MuJoCo compiles it."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from mjsense.dataset.png_sizes import image_size, unpacked_size

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_ARENA = 2 << 30  # bytes
MAX_PIXELS = 1 << 30  # bytes of all textures and height fields; 300 textures of 1024 x 1024 have this
MAX_ELEMENTS = 300_000
"""After ``replicate`` and ``composite``."""
MAX_COPIES, MAX_COPIES_WITH_SENSORS = 4000, 8
"""By ``replicate``. MuJoCo 4.0.1 needs time that grows with their square and, with some sensors, doubles with each copy. It
writes models without ``replicate``, so that recordings have none."""
MAX_NUMBERS = 50_000_000
"""Numbers of sparse matrices, keyframes, histories, user data and tables."""
MAX_LINE = 1 << 13
"""Bytes of a line of an OBJ file: MuJoCo needs time that grows with the square of a polygon's corners, 9 s for 60,000."""
MAX_SUBSTEPS = 100_000
MAX_LENGTH_WORK = 300_000_000
"""Elements x steps that the compiler simulates to find the ranges of muscles. 80 muscles in a model of 500 elements take a
quarter of it."""

_FACTORS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40, "P": 1 << 50, "E": 1 << 60}
_DOFS = {"free": 6, "ball": 3}
_ACTUATORS = set(
    """
    general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin
    """.split()
)
_LIMITS: dict[str, dict[str, int]] = {
    "option": dict.fromkeys(
        ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations", "sdf_initpoints"), 10_000
    ),
    "size": {"njmax": 10_000_000, "nconmax": 1_000_000, "nstack": MAX_ARENA // 8, "nuserdata": 1_000_000, "nkey": 10_000},
    "numeric": {"size": 1_000_000},
    "user": {"dim": 1_000_000},
    "contact": {"num": 10_000},
    "mesh": {"maxhullvert": 1_000_000, "octree_maxdepth": 10},
    "camera": {"resolution": 16_384},
    "flexcomp": {"count": 1000, "cellcount": 1000},
    "flex": {"cellcount": 1000},
    "texture": {"width": 1 << 16, "height": 1 << 16, "nchannel": 4, "gridsize": 64},
    "hfield": {"nrow": 1 << 16, "ncol": 1 << 16},
}
"""Largest values of attributes that are counts, by element. They bound each; their products are bounded below."""


def check_sizes(root: Element, members: Mapping[str, bytes], about: str) -> None:
    """Raises ValueError, which names the limit, if the model would need too much memory or time."""
    _Sizes(root, members, about)


class _Sizes:
    def __init__(self, root: Element, members: Mapping[str, bytes], about: str) -> None:
        self._about = about
        self._defaults: dict[tuple[str, str], int] = {}
        """The largest value of an attribute in any class of defaults."""
        self._members = members
        self._numbers = self._elements = 0
        self._check_limits(root)
        self._check_options(root)
        self._check_images(root)
        self._check_meshes(root)
        self._max_copies = MAX_COPIES_WITH_SENSORS if any(len(section) for section in root.iter("sensor")) else MAX_COPIES
        dofs = self._tree(root, 1, 0)
        self._check_tables(root, dofs)
        self._check_muscles(root)

    def _fail(self, what: str, found: object, limit: object) -> None:
        raise ValueError(f"{self._about}: {what} is {found}, the limit is {limit}")

    def _whole(self, element: Element, key: str) -> list[int]:
        """Whole numbers of an attribute, without their signs."""
        words = element.attrib[key].split()
        if not all(re.fullmatch(r"[+-]?\d{1,12}", word) for word in words) or not words:
            self._fail(f"{key} of '{element.tag[:40]}'", repr(element.attrib[key][:60]), "a whole number of 12 digits")
        return [abs(int(word)) for word in words]

    def _value(self, element: Element, key: str, otherwise: int) -> int:
        """The product of an attribute's numbers, or that of a class of defaults."""
        if key in element.attrib:
            return math.prod(self._whole(element, key))
        return max(self._defaults.get((element.tag, key), 0), otherwise)

    def _add(self, numbers: int, what: str) -> None:
        self._numbers += numbers
        if self._numbers > MAX_NUMBERS:
            self._fail(f"the count of numbers with {what}", self._numbers, MAX_NUMBERS)

    def _check_limits(self, root: Element) -> None:
        for element in root.iter():
            for key, limit in _LIMITS.get(element.tag, {}).items():
                if key in element.attrib and max(self._whole(element, key)) > limit:
                    self._fail(f"{key} of '{element.tag}'", element.attrib[key][:60], limit)
            if element.tag == "size":
                for key in element.attrib:
                    if key.startswith("nuser_") and max(self._whole(element, key)) > 10_000:
                        self._fail(f"{key} of 'size'", element.attrib[key], 10_000)
            if "nsample" in element.attrib and max(self._whole(element, "nsample")) > 10_000:
                self._fail(f"nsample of '{element.tag[:40]}'", element.attrib["nsample"], 10_000)
        for default in root.iter("default"):
            for element in default:
                for key in ("width", "height", "nchannel", "nsample", "resolution"):
                    if key in element.attrib:
                        place = element.tag, key
                        self._defaults[place] = max(self._defaults.get(place, 0), math.prod(self._whole(element, key)))

    def _check_options(self, root: Element) -> None:
        for size in root.iter("size"):
            match = re.fullmatch(r"\s*(?:-1|(\d{1,12})([KMGTPE]?))\s*", size.get("memory", "-1"), re.IGNORECASE)
            if match is None:
                self._fail(
                    "memory of 'size'", repr(size.get("memory", "")[:60]), "a whole number of bytes, perhaps with K, M or G"
                )
            elif match[1] and int(match[1]) * _FACTORS[match[2].upper()] > MAX_ARENA:
                self._fail("memory of 'size'", size.get("memory"), f"{MAX_ARENA} bytes")
        for lengths in root.iter("lengthrange"):
            try:
                steps = float(lengths.get("inttotal", "10")) / float(lengths.get("timestep", "0.01"))
            except (ValueError, ZeroDivisionError):
                steps = math.inf
            if not 0 <= steps <= MAX_SUBSTEPS:
                self._fail("inttotal / timestep of 'lengthrange'", f"{steps:g}", f"{MAX_SUBSTEPS} steps")

    def _check_muscles(self, root: Element) -> None:
        """The compiler simulates the model for each muscle without a length range."""
        steps = 1000.0
        for lengths in root.iter("lengthrange"):
            steps = float(lengths.get("inttotal", "10")) / float(lengths.get("timestep", "0.01"))
        muscles = sum(
            "lengthrange" not in one.attrib
            for one in root.iter()
            if one.tag == "muscle" or "muscle" in (one.get("gaintype"), one.get("biastype"))
        )
        if (work := 2 * muscles * steps * self._elements) > MAX_LENGTH_WORK:
            self._fail("the work for the length ranges of muscles (elements x steps)", f"{work:g}", MAX_LENGTH_WORK)

    def _check_images(self, root: Element) -> None:
        total, unpacked = 0, dict[str, int]()
        for element in root.iter():
            if element.tag not in ("texture", "hfield"):
                continue
            files = [element.attrib[key] for key in element.attrib if key.startswith("file")]
            # A number of a height field has 4 bytes.
            channels = self._value(element, "nchannel", 3) if element.tag == "texture" else 4
            for name in files:
                content = self._members[name]
                width, height = image_size(content)
                if width * height * channels <= MAX_PIXELS - total and name not in unpacked:
                    unpacked[name] = unpacked_size(content, f"{self._about}: the image {name[:120]!r}")
                total += max(width * height * channels, len(content), unpacked.get(name, 0))
            if not files and element.tag == "texture":
                width = self._value(element, "width", 0)
                sides = 1 if element.get("type", "cube") == "2d" else 6
                total += width * max(self._value(element, "height", 0), sides * width if sides > 1 else 0) * channels
            elif not files:
                total += self._value(element, "nrow", 0) * self._value(element, "ncol", 0) * channels
            if total > MAX_PIXELS:
                self._fail(
                    f"the size of the textures and height fields up to the {element.tag} '{element.get('name', '')[:80]}'",
                    f"{total} bytes",
                    MAX_PIXELS,
                )

    def _check_meshes(self, root: Element) -> None:
        named = {(mesh.get("file", ""), mesh.get("content_type", "")) for mesh in root.iter("mesh")}
        for name in {name for name, kind in named if name.lower().endswith(".obj") or (name and kind == "model/obj")}:
            if (longest := max(map(len, io.BytesIO(self._members[name])), default=0)) > MAX_LINE:
                self._fail(f"the longest line of the mesh {name[:120]!r}", longest, f"{MAX_LINE} bytes")
        for mesh in root.iter("mesh"):
            if "builtin" not in mesh.attrib:
                continue
            try:
                product = math.prod(max(1.0, abs(float(word))) for word in mesh.get("params", "").split())
            except ValueError:
                product = math.inf
            deep = 4.0**product if mesh.get("builtin") in ("sphere", "hemisphere") and product < 20 else product
            if not deep <= 1_000_000:
                self._fail(
                    f"the product of params of the mesh '{mesh.get('name', '')[:80]}'",
                    repr(mesh.get("params", "")[:60]),
                    "10 subdivisions or 1,000,000",
                )

    def _tree(self, element: Element, copies: int, above: int) -> int:
        """Counts the elements below, each ``copies`` times, and the numbers of the inertia matrix. Returns the degrees of
        freedom.

        ``above``: degrees of freedom between the world and the element.
        """
        if element.tag in ("replicate", "composite", "flexcomp"):
            copies *= max(1, self._value(element, "count", 1))
            if element.tag == "replicate" and copies > self._max_copies:
                self._fail(
                    "the number of copies by replicate",
                    copies,
                    f"{self._max_copies}{' with sensors' if self._max_copies < MAX_COPIES else ''}",
                )
        self._elements += copies * (10 if element.tag in ("composite", "flexcomp") else 1)
        if self._elements > MAX_ELEMENTS:
            self._fail("the number of elements after replicate and composite", self._elements, MAX_ELEMENTS)
        own = sum(
            _DOFS.get(joint.get("type", "hinge"), 1) if joint.tag == "joint" else 6
            for joint in element
            if joint.tag in ("joint", "freejoint")
        )
        if element.tag == "composite":
            own += 3
        self._add(copies * own * (above + own), "the inertia matrix")
        below = above + own if element.tag == "body" else above
        return copies * own + sum(self._tree(child, copies, below) for child in element)

    def _check_tables(self, root: Element, dofs: int) -> None:
        for size in root.iter("size"):
            self._add(max(1, self._value(size, "nkey", 1)) * (3 * dofs + 20), "keyframes")
            users = sum(self._whole(size, key)[0] for key in size.attrib if key.startswith("nuser_"))
            self._add(users * self._elements, "user data")
        for tag in ("tendon", "sensor", "actuator", "custom"):
            for section in root.iter(tag):
                for element in section:
                    history = self._defaults_of_actuators() if element.tag in _ACTUATORS else 1
                    self._add(
                        self._length(root, tag, element, dofs) * max(1, self._value(element, "nsample", 1), history),
                        f"the {tag} '{element.get('name', '')[:80]}'",
                    )
        for config in root.iter("config"):
            for word in config.get("value", "").split():
                if re.fullmatch(r"[+-]?\d+", word) and abs(int(word[:20])) > 1000 and config.get("key") == "size":
                    self._fail("the size of a plugin", word[:40], 1000)

    def _length(self, root: Element, section: str, element: Element, dofs: int) -> int:
        """Upper bound of the numbers of one value of a tendon, sensor, actuator or custom element."""
        if element.tag == "rangefinder" and "camera" in element.attrib:
            pixels = [
                self._value(camera, "resolution", 1)
                for camera in root.iter("camera")
                if camera.get("name") == element.get("camera")
            ]
            return 8 * max(pixels, default=self._defaults.get(("camera", "resolution"), 1))
        if element.tag == "numeric":
            return self._value(element, "size", 1)
        if section == "sensor":
            return 16 * self._value(element, "dim", 1) * self._value(element, "num", 1)
        return dofs if section == "tendon" else 1

    def _defaults_of_actuators(self) -> int:
        return max([1, *(value for (tag, key), value in self._defaults.items() if key == "nsample" and tag in _ACTUATORS)])
