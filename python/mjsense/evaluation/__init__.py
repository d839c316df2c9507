# SPDX-License-Identifier: Apache-2.0
"""Evaluation of policies: fixed episodes of a task are played and recorded, and their results are counted. Modules are imported
when they are used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mjsense.evaluation.benchmarks import Benchmark as Benchmark
    from mjsense.evaluation.benchmarks import create_benchmark as create_benchmark
    from mjsense.evaluation.comparison import Comparison as Comparison
    from mjsense.evaluation.comparison import compare as compare
    from mjsense.evaluation.molmospaces_export import export_molmospaces as export_molmospaces
    from mjsense.evaluation.playing import evaluate as evaluate
    from mjsense.evaluation.policies import policy_from as policy_from
    from mjsense.evaluation.protocol import BatchedPolicy as BatchedPolicy
    from mjsense.evaluation.remote.policy import RemotePolicy as RemotePolicy
    from mjsense.evaluation.remote.server import PolicyServer as PolicyServer
    from mjsense.evaluation.report import Results as Results
    from mjsense.evaluation.report import results as results
    from mjsense.evaluation.timing import Timed as Timed
    from mjsense.evaluation.timing import wrap_policy as wrap_policy
    from mjsense.evaluation.varied import Sensitivity as Sensitivity
    from mjsense.evaluation.varied import sensitivity as sensitivity

_PLACES: dict[str, str] = {
    "Benchmark": "benchmarks",
    "BatchedPolicy": "protocol",
    "Comparison": "comparison",
    "PolicyServer": "remote.server",
    "RemotePolicy": "remote.policy",
    "Results": "report",
    "Sensitivity": "varied",
    "Timed": "timing",
    "compare": "comparison",
    "create_benchmark": "benchmarks",
    "evaluate": "playing",
    "export_molmospaces": "molmospaces_export",
    "policy_from": "policies",
    "results": "report",
    "sensitivity": "varied",
    "wrap_policy": "timing",
}
"""Module of each public name."""
__all__ = [
    "BatchedPolicy",
    "Benchmark",
    "Comparison",
    "PolicyServer",
    "RemotePolicy",
    "Results",
    "Sensitivity",
    "Timed",
    "compare",
    "create_benchmark",
    "evaluate",
    "export_molmospaces",
    "policy_from",
    "results",
    "sensitivity",
    "wrap_policy",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_PLACES[name]}"), name)
