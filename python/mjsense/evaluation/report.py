# SPDX-License-Identifier: Apache-2.0
"""Results of an evaluation, or of any recording: a table with a row for each episode, and a report."""

from __future__ import annotations

import dataclasses
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mjsense.core.arguments import checked
from mjsense.core.optional import optional
from mjsense.dataset import Dataset
from mjsense.evaluation.facts import facts_of, warnings_of
from mjsense.evaluation.page import page_of
from mjsense.evaluation.rows import Group, Row, group_of, groups_by, rows_of
from mjsense.evaluation.summary import text_of

if TYPE_CHECKING:
    import pyarrow  # pyright: ignore[reportMissingImports]  # optional

TABLE, PAGE = "results.parquet", "report.html"


@dataclass(frozen=True)
class Results:
    """Results of :func:`results`. ``print(results)`` is the report as text."""

    rows: list[Row]
    """A row for each episode."""
    facts: list[tuple[str, str]]
    """Names and texts of what was evaluated: policy, task, benchmark, fingerprints."""
    warnings: list[str]
    """Reasons why the success rate may not be that of the policy."""
    dataset: Dataset
    """The recording."""

    @property
    def success(self) -> Group:
        """All episodes: ``rate`` is the success rate, ``interval`` its 95 % interval."""
        return group_of(self.rows)

    def by(self, column: str) -> list[Group]:
        """Successes for each value of a column, such as ``object``."""
        names = [field.name for field in dataclasses.fields(Row)]
        if column not in names:
            from mjsense.core.errors import UnknownNameError, did_you_mean

            raise UnknownNameError(f"results have no column '{column}'{did_you_mean(column, names, 'there are')}")
        return groups_by(self.rows, column)

    def __str__(self) -> str:
        return text_of(self.rows, self.facts, self.warnings)

    def to_table(self) -> pyarrow.Table:
        """The rows as a table of pyarrow; NaN, and -1 for an unknown number, become null."""
        arrow = require_parquet()
        columns = {field.name: [_known(getattr(row, field.name)) for row in self.rows] for field in dataclasses.fields(Row)}
        types = {"int": arrow.int64(), "bool": arrow.bool_(), "float": arrow.float64(), "str": arrow.string()}
        kinds = {field.name: types[str(field.type)] for field in dataclasses.fields(Row)}
        schema = arrow.schema({**kinds, "seed": arrow.uint64()})
        return arrow.table(columns, schema=schema)

    def to_html(self) -> str:
        """The report as one page of HTML, which contains its images and runs no code."""
        return page_of(self.dataset, self.rows, self.facts, self.warnings)

    def write(self, folder: str | Path) -> list[Path]:
        """Writes ``results.parquet`` and ``report.html`` and returns their paths. Existing ones are replaced."""
        table = self.to_table()
        parquet, page = Path(folder) / TABLE, Path(folder) / PAGE
        parts = [path.with_name(f".{path.name}.part") for path in (parquet, page)]
        optional("pyarrow.parquet", "evaluate", "results.parquet").write_table(table, parts[0])
        parts[1].write_text(self.to_html(), encoding="utf-8")
        for part, path in zip(parts, (parquet, page)):
            os.replace(part, path)
        return [parquet, page]


def require_parquet() -> Any:
    """The package pyarrow.

    Raises:
        ModuleNotFoundError: It is not installed.
    """
    return optional("pyarrow", "evaluate", "results.parquet")


@checked
def results(recording: str | Path | Dataset) -> Results:
    """Results of an evaluation, or of any recording.

    Args:
        recording: Folder of the evaluation or recording, or a :class:`Dataset`, whose episodes count.

    Raises:
        ValueError: It has no episodes.
    """
    dataset = recording if isinstance(recording, Dataset) else Dataset(recording)
    if not dataset.episodes:
        raise ValueError(f"{dataset.root} has no episodes")
    rows = rows_of(dataset)
    return Results(rows, facts_of(dataset, rows), warnings_of(dataset, rows), dataset)


def _known(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return None if value == -1 and not isinstance(value, (bool, float)) else value
