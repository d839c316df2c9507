# SPDX-License-Identifier: Apache-2.0
"""Damaged footers of an index, with which pyarrow ends the process."""

import contextlib

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

from mjsense.dataset import index, parquet_footer

ROW = {"episode": [0], "path": ["a.h5"], "trajectory": ["traj_0"], "seed": [1], "length": [2], "success": [True], "outcome": ["success"], "task": ["pick"]}


@pytest.mark.parametrize("codec", ("NONE", "SNAPPY", "GZIP", "BROTLI", "ZSTD", "LZ4"))
def test_codecs_are_those_of_pyarrow(tmp_path, codec):
    path = tmp_path / "index.parquet"
    pq.write_table(pa.table(ROW), path, compression=codec)
    with open(path, "rb") as file:
        assert parquet_footer.codecs(path, file) == {pq.read_metadata(path).row_group(0).column(0).compression.replace("LZ4", "LZ4_RAW")}


def test_a_damaged_footer_does_not_end_the_process(tmp_path):
    path, rng, refused = tmp_path / "index.parquet", np.random.default_rng(0), 0
    pq.write_table(pa.table(ROW), path)
    content = path.read_bytes()
    for _ in range(600):
        changed = bytearray(content)
        changed[rng.integers(len(content) // 2, len(content))] = rng.integers(256)
        path.write_bytes(changed)
        refused += 1
        with contextlib.suppress(ValueError):
            index.rows_of(path)
            refused -= 1
    assert 0 < refused < 600
