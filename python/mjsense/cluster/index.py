# SPDX-License-Identifier: Apache-2.0
"""``index.parquet``: the episodes of a job, with the shards' files that contain them."""

from __future__ import annotations

import io
from collections.abc import Sequence

from mjsense.cluster.job import ShardResult
from mjsense.cluster.storage import Storage
from mjsense.core.optional import optional
from mjsense.dataset.files import INDEX


def write_index(storage: Storage, results: Sequence[ShardResult], episodes: int) -> int:
    """Writes one row for each of the first ``episodes`` episodes, in the order of attempts. Paths are relative to the index.

    Returns:
        The number of rows.
    """
    pyarrow, parquet = (optional(module, "ray", "The index") for module in ("pyarrow", "pyarrow.parquet"))
    rows = [
        {**row, "path": f"{result.shard.folder}/{row['path']}"}
        for result in results
        for row in sorted(result.episodes, key=lambda row: row["episode"])
    ]
    kinds = {
        "episode": "int64",
        "path": "string",
        "trajectory": "string",
        "seed": "uint64",
        "length": "int64",
        "success": "bool_",
        "outcome": "string",
        "task": "string",
    }
    schema = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in kinds.items()])
    table = pyarrow.Table.from_pylist(rows[:episodes], schema=schema)
    data = io.BytesIO()
    parquet.write_table(table, data)
    storage.write(INDEX, data.getvalue())
    return len(table)
