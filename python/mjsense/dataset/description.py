# SPDX-License-Identifier: Apache-2.0
"""The attribute ``recording`` of a file: what it states about the recording, checked.

A recording is not trusted. Keys that are not listed here are ignored, and no option of our own programs is taken from it but
those in ``_VIDEO``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from mjsense.core.declared_fields import declared_fields
from mjsense.dataset import bounded_json
from mjsense.dataset.limits import DESCRIPTION_BYTES, IMAGE_PIXELS, IMAGE_SIDE, PERIOD_MS, RATE_DIGITS, RATES, TEXT_BYTES
from mjsense.dataset.places import is_plain_name, printable

_RATE = re.compile(rf"[0-9]{{1,{RATE_DIGITS}}}(/[0-9]{{1,{RATE_DIGITS}}})?")
_PRESETS = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow", "placebo")
_TUNES = ("", "fastdecode", "zerolatency", "film", "animation", "grain", "stillimage", "psnr", "ssim")
_PROVENANCE = tuple(
    """
    attempts batches episodes first_attempt first_batch format fps gzip house model model_archive num_attempts settings
    streams versions
    """.split()
)
# A name of something that mjsense contains; a path has a dot, or begins with a slash.
_KNOWN_THING = re.compile(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*(@[a-z]+)?(:[0-9]{1,9})?")
_OF_RECORD = "terminate_upon_success"  # a setting that mjs.record always writes
_THINGS = ("task", "robot", "scene", "arm_controller", "camera_system", "environment")

Check = Callable[[Any], bool]


def _whole(low: int, high: int) -> tuple[Check, str]:
    return lambda v: isinstance(v, int) and not isinstance(v, bool) and low <= v <= high, f"a whole number from {low} to {high}"


def _between(low: float, high: float) -> tuple[Check, str]:
    def check(v: Any) -> bool:
        return isinstance(v, (int, float)) and not isinstance(v, bool) and low < v <= high

    return check, f"a number above {low:g}, and at most {high:g}"


def _word(words: tuple[str, ...]) -> tuple[Check, str]:
    return lambda v: isinstance(v, str) and v in words, f"one of {', '.join(filter(None, words))}"


def _vector(size: int) -> tuple[Check, str]:
    return lambda v: isinstance(v, list) and len(v) == size and all(map(_is_finite, v)), f"a list of {size} numbers"


def _is_finite(v: Any) -> bool:
    return isinstance(v, (int, float)) and not isinstance(v, bool) and abs(v) < 1e300


_BOOL: tuple[Check, str] = (lambda v: isinstance(v, bool), "true or false")


def _declared(option: dict[str, Any]) -> tuple[Check, str]:
    """The rule of an option that is a number, a word, a text, or true or false, from its declaration."""
    kind, low, high = option["type"]["kind"], option.get("low", -1e300), option.get("high", 1e300)
    if kind == "bool":
        return _BOOL
    if kind == "text":
        return _TEXT
    if kind == "word":
        words: list[str] = option["type"]["words"]
        return (lambda v: isinstance(v, str) and v in words), f"one of {', '.join(words)}"

    def check(v: Any) -> bool:
        is_of_kind = isinstance(v, int) or kind != "int"
        return _is_finite(v) and is_of_kind and low <= v <= high and not (option["above_low"] and v == low)

    return check, f"a{' whole' if kind == 'int' else ''} number from {low:g} to {high:g}"


_TEXT: tuple[Check, str] = (lambda v: isinstance(v, str) and len(v) <= TEXT_BYTES, f"a text of at most {TEXT_BYTES} characters")
_NAME: tuple[Check, str] = (lambda v: isinstance(v, str) and is_plain_name(v), "a plain name, without a folder")
# A camera's name may have the name of its robot in front: robot_0/wrist.
_PARTS: tuple[Check, str] = (
    lambda v: isinstance(v, str) and all(map(is_plain_name, v.split("/"))),
    "a plain name, without .. and empty parts",
)
_TABLE: tuple[Check, str] = (lambda v: isinstance(v, dict), "an object")
_LIST: tuple[Check, str] = (lambda v: isinstance(v, list), "a list")

_VIDEO: dict[str, tuple[Check, str]] = {
    "crf": _whole(0, 51),
    "preset": _word(_PRESETS),
    "tune": _word(_TUNES),
    "keyint": _whole(1, 100_000),
    "threads": _whole(1, 64),
    "depth_unit": _between(0, 1000),
    "molmospaces_depth": _BOOL,
}
_SETTINGS: dict[str, tuple[Check, str]] = {
    "policy_dt_ms": _between(0, PERIOD_MS),
    "shadows": _BOOL,
    "meshes": _word(("shapes", "real", "auto")),
    "robot": _TEXT,
    "task": _TEXT,
    "scene": _TEXT,
    "camera_system": _TEXT,
    "code": _TABLE,
    "render": _TABLE,
    "cameras": _LIST,
}
_CAMERA: dict[str, tuple[Check, str]] = {
    "name": _PARTS,
    "width": _whole(1, IMAGE_SIDE),
    "height": _whole(1, IMAGE_SIDE),
    "depth": _BOOL,
    "segmentation": _BOOL,
    "camera": _TEXT,
    "body": _TEXT,
    "pos": _vector(3),
    "quat": _vector(4),
    "fovy": _between(0, 180),
}


@dataclass(frozen=True)
class Description:
    """What a file states about its recording. Every value has the right type and is in its range."""

    fps: Fraction | None = None
    """Observations per second; None: not stated."""
    model_archive: str = ""
    """File name of the archived model; empty: none."""
    gzip: int = 4
    video: dict[str, Any] | None = None
    """Options of the recorder that give equal videos of equal images; None: no videos were recorded."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings that produced the data, JSON values. Those that mjsense reads have the right type and are in their range."""
    all_settings: dict[str, Any] = field(default_factory=dict)
    """The same with the settings of other programs, whatever their values are."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """The known keys of the text, for a recording that is made from this one."""

    @staticmethod
    def parse(text: str | bytes, where: str) -> Description:
        """The checked description.

        Args:
            where: The file, for errors.

        Raises:
            ValueError: A value has the wrong type or is out of range. The text names the key.
        """
        what = f"{where}: the attribute 'recording'"
        table = bounded_json.parse_object(text, what, DESCRIPTION_BYTES)
        _check_finite(what, table)
        archive, settings, video = table.get("model_archive", ""), table.get("settings", {}), table.get("video")
        if archive != "":
            _check(what, "model_archive", archive, _NAME)
        _check(what, "settings", settings, _TABLE)
        _check(what, "gzip", table.get("gzip", 4), _whole(0, 9))
        chosen = None
        if video is not None:
            _check(what, "video", video, _TABLE)
            chosen = {"tune": "", **_chosen(what, "video", video, _VIDEO)}  # recordings of older versions have no tuning
            chosen = {"encoder_threads" if key == "threads" else key: value for key, value in chosen.items()}
        known = _checked_settings(f"{what}: settings", settings)
        provenance = {key: table[key] for key in _PROVENANCE if key in table}
        if video is not None:
            provenance["video"] = {key: video[key] for key in _VIDEO if key in video}
        fps = None if "fps" not in table else rate_of(table["fps"], f"{what}: fps")
        return Description(fps, archive, table.get("gzip", 4), chosen, known, settings, provenance)


def rate_of(value: Any, what: str) -> Fraction:
    """Observations per second: ``"500/33"`` or a number."""
    text = value if isinstance(value, str) else None
    if isinstance(value, (int, float)) and not isinstance(value, bool) and RATES[0] <= value <= RATES[1]:
        return Fraction(value).limit_denominator(10**6)
    if text is not None and _RATE.fullmatch(text) and (low := int(text.partition("/")[2] or 1)):
        rate = Fraction(int(text.partition("/")[0]), low)
        if RATES[0] <= rate <= RATES[1]:
            return rate
    shown = printable(repr(value)[:60])
    raise ValueError(
        f"{what} is {shown}; it must be a rate from {RATES[0]:g} to {RATES[1]:g} as '15' or '500/33', of at most "
        f"{RATE_DIGITS} digits each"
    )


def image_size(width: Any, height: Any, what: str) -> tuple[int, int]:
    """Width and height of images."""
    for name, value in (("width", width), ("height", height)):
        if not isinstance(value, int) or not 1 <= value <= IMAGE_SIDE:
            raise ValueError(f"{what}: {name} is {printable(repr(value)[:50])}; it must be a whole number from 1 to {IMAGE_SIDE}")
    if width * height > IMAGE_PIXELS:
        raise ValueError(f"{what} has images of {width} x {height} pixels, more than {IMAGE_PIXELS}")
    return width, height


def is_known_thing(name: Any) -> bool:
    """Whether a setting names a task, robot, scene, controller, camera system or surroundings that mjsense contains, or may
    contain, and not a file."""
    return name is None or (isinstance(name, str) and (not name or _KNOWN_THING.fullmatch(name) is not None))


def named_file(settings: dict[str, Any]) -> str:
    """Which of the settings name a file: ``"robot 'mine/robot.toml'"``. Files are not taken from a recording. Empty: none
    does."""
    return ", ".join(f"{key} '{printable(str(settings[key])[:100])}'" for key in _THINGS if not is_known_thing(settings.get(key)))


def _checked_settings(what: str, settings: dict[str, Any]) -> dict[str, Any]:
    """The settings, without those of other programs that have the name of a known setting. In a recording of ``mjs.record``, a
    wrong value is an error."""
    known = dict(settings)

    def check(key: str, value: Any, rule: tuple[Check, str], name: str = "") -> None:
        if not rule[0](value):
            if _OF_RECORD in settings:
                _check(what, name or key, value, rule)
            known.pop(key, None)

    colours = {name: _declared(field) for name, field in declared_fields("RgbCfg").items()}
    for key, rule in (_SETTINGS | colours).items():
        if key in known:
            check(key, known[key], rule)
    if "brightness" in known.get("render", {}):
        check("render", known["render"]["brightness"], _between(0, 1e6), "render.brightness")
    cameras = [camera for camera in known.get("cameras", []) if isinstance(camera, dict) or _OF_RECORD in settings]
    for i, camera in enumerate(cameras):
        place = f"cameras[{i}]"
        check("cameras", camera, _TABLE, place)
        for key, rule in _CAMERA.items():
            if key in ("name", "width", "height") or key in camera:
                check("cameras", camera.get(key), rule, f"{place}.{key}")
        if "cameras" in known:
            image_size(camera["width"], camera["height"], f"{what}: {place}")
    if "cameras" in known:
        known["cameras"] = [{key: value for key, value in camera.items() if key in _CAMERA} for camera in cameras]
        if len({camera["name"] for camera in known["cameras"]}) < len(cameras):
            raise ValueError(f"{what}: two cameras have the same name")
    return known


def _check_finite(what: str, value: Any) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            _check_finite(what, inner)
    elif isinstance(value, list):
        for inner in value:
            _check_finite(what, inner)
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{what} contains the number {value}; all numbers must be finite")


def _chosen(what: str, place: str, table: dict[str, Any], rules: dict[str, tuple[Check, str]]) -> dict[str, Any]:
    """The keys of a table that have a rule; others are ignored."""
    for key in rules.keys() & table.keys():
        _check(what, f"{place}.{key}", table[key], rules[key])
    return {key: value for key, value in table.items() if key in rules}


def _check(what: str, place: str, value: Any, rule: tuple[Check, str]) -> None:
    if not rule[0](value):
        raise ValueError(f"{what}: {place} is {printable(repr(value)[:60])}; it must be {rule[1]}")
