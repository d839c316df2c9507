# SPDX-License-Identifier: Apache-2.0
"""What was evaluated, and how: the settings of a recording, and ``evaluation.json``, which an evaluation writes into its
folder."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from mjsense.core.representations import plain
from mjsense.dataset import Dataset, bounded_json
from mjsense.dataset.places import read_plain
from mjsense.evaluation.rows import Row, key_of

FILE = "evaluation.json"
_FILE_BYTES = 1 << 20
_PARTS = ("policy", "benchmark", "data", "settings")


def evaluation_of(root: Path) -> dict[str, Any]:
    """The contents of ``evaluation.json``; an empty object for other recordings."""
    path = root / FILE
    try:
        table = bounded_json.parse_object(read_plain(path, _FILE_BYTES), str(path), _FILE_BYTES)
    except FileNotFoundError:
        return {}
    for part in _PARTS:
        if part in table and not isinstance(table[part], (dict, type(None))):
            raise ValueError(f"{path}: {part} is {bounded_json.kind_of(table[part])}; it must be an object")
    return table


def settings_of(dataset: Dataset) -> list[dict[str, Any]]:
    """The different settings with which the episodes were recorded."""
    found: dict[str, dict[str, Any]] = {}
    for episode in {episode._entry.recording: episode for episode in dataset.episodes}.values():
        settings = episode.settings
        found.setdefault(json.dumps(settings, sort_keys=True), settings)
    return list(found.values())


def facts_of(dataset: Dataset, rows: list[Row]) -> list[tuple[str, str]]:
    """Names and texts of what was evaluated."""
    evaluation, settings = evaluation_of(dataset.root), settings_of(dataset)
    policy, benchmark, data = (evaluation.get(part) or {} for part in ("policy", "benchmark", "data"))
    stated = [
        ("policy", policy.get("spec") or _values(settings, "policy")),
        ("fingerprint of the policy", policy.get("fingerprint")),
        ("settings of the policy", policy.get("settings")),
        ("task", _values(settings, "task")),
        ("robot", _values(settings, "robot")),
        ("scene", _values(settings, "scene")),
        ("seed", _values(settings, "seed")),
        ("horizon [steps]", _values(settings, "horizon")),
        ("duration of an action [ms]", _values(settings, "policy_dt_ms")),
        ("benchmark", _joined(benchmark.get("name"), benchmark.get("checksum"))),
        ("data", _joined(data.get("path"), data.get("fingerprint"))),
        ("execution of actions", evaluation.get("settings")),
        ("versions", dataset.episodes[0]._recording.provenance.get("versions") if dataset.episodes else None),
        ("recording", str(dataset.root)),
        ("fingerprint of the results", fingerprint(settings, rows)),
    ]
    return [(name, _text(value)) for name, value in stated if value not in (None, "", {}, [])]


def warnings_of(dataset: Dataset, rows: list[Row]) -> list[str]:
    """Reasons why the success rate may not be that of the policy."""
    found = []
    if any(settings.get("keep_failures") is False for settings in settings_of(dataset)):
        found.append(
            "Failed episodes were not kept, so the success rate is that of the kept episodes only; --keep-failures "
            "(keep_failures=True) records all."
        )
    if len({key_of(row) for row in rows}) < len(rows):
        found.append("Some episodes are in the recording more than once.")
    return found


def fingerprint(settings: list[dict[str, Any]], rows: list[Row]) -> str:
    """SHA-256 of the settings, and of the number, outcome and length of each episode."""
    told = [settings, [[*key_of(row), row.success, row.failure, row.steps] for row in rows]]
    return "sha256:" + hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _values(settings: list[dict[str, Any]], name: str) -> str:
    """The different values of a setting; those that are neither texts nor whole numbers are left out."""
    values = [one.get(name) for one in settings]
    return ", ".join(dict.fromkeys(str(value) for value in values if value != "" and type(value) in (str, int)))


def _joined(*parts: Any) -> str:
    return ", ".join(str(part) for part in parts if part)


def _text(value: Any) -> str:
    if isinstance(value, dict):
        value = ", ".join(f"{key} {inner}" for key, inner in sorted(value.items()))
    return plain(value)
