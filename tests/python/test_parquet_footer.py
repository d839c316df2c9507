# SPDX-License-Identifier: Apache-2.0
"""Footers and pages of Parquet files; pyarrow ends the process when it reads some damaged footers."""

import contextlib
import gzip
import io
import struct
from pathlib import Path

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

from mjsense.dataset import index, parquet_footer
from mjsense.dataset.lerobot_reader import LeRobotReader

ROW = {"episode": [0], "path": ["house_0/trajectories_batch_1_of_1.h5"], "trajectory": ["traj_0"], "seed": [1], "length": [2], "success": [True], "outcome": ["success"], "task": ["pick"]}


def lerobot_reader(path):
    """Reads a table as the import of LeRobot data sets does."""
    source = object.__new__(LeRobotReader)
    source.root, source._tables = path.parent, pq
    return source._table


@pytest.mark.parametrize("codec", ("NONE", "SNAPPY", "GZIP", "BROTLI", "ZSTD", "LZ4"))
def test_the_footer_says_what_pyarrow_says(tmp_path, codec):
    path = tmp_path / "index.parquet"
    pq.write_table(pa.table({**{key: value * 5 for key, value in ROW.items()}, "list": [[1, 2]] * 5}), path, compression=codec, row_group_size=2)
    about = pq.read_metadata(path)
    groups = [about.row_group(i) for i in range(about.num_row_groups)]
    columns = [group.column(i) for group in groups for i in range(group.num_columns)]
    with open(path, "rb") as file:
        footer = parquet_footer.read(path, file)
    assert (footer.rows, footer.values) == (5, sum(column.num_values for column in columns)) and len(groups) == 3
    assert 0 < footer.bytes < sum(column.total_uncompressed_size for column in columns)  # which count headers, too
    assert footer.codecs == {column.compression.replace("LZ4", "LZ4_RAW") for column in columns}


@pytest.mark.parametrize("reader", (lambda path: index.rows_of, lerobot_reader), ids=("index", "lerobot"))
def test_a_damaged_footer_does_not_end_the_process(tmp_path, reader):
    path, rng, refused = tmp_path / "index.parquet", np.random.default_rng(0), 0
    pq.write_table(pa.table(ROW), path)
    content, read = path.read_bytes(), reader(path)
    for _ in range(600):
        changed = bytearray(content)
        changed[rng.integers(len(content) // 2, len(content))] = rng.integers(256)
        path.write_bytes(changed)
        refused += 1
        with contextlib.suppress(ValueError):
            read(path)
            refused -= 1
    assert 0 < refused < 600


def footer(content):
    return io.BytesIO(b"PAR1" + content + struct.pack("<I", len(content)) + b"PAR1")


def many(count, value):
    """The field 1: a list of so many values of the kind of a struct."""
    number = b"".join(bytes([count >> shift & 127 | (128 if count >> shift + 7 else 0)]) for shift in range(0, count.bit_length(), 7))
    return b"\x19\xfc" + number + value * count


@pytest.mark.parametrize("content", (b"\x19" * 100_000, b"\x1c" * 100_000, many(20_000, b"\0")), ids=("lists", "structs", "values"))
def test_a_footer_is_not_larger_in_memory_than_columns_need(monkeypatch, content):
    """Before, 100 kB of nested lists were a RecursionError, and 64 MB of empty structs took 5 GB."""
    assert 500_000 < parquet_footer._MAX_VALUES < 5_000_000
    monkeypatch.setattr(parquet_footer, "_MAX_VALUES", 10_000)
    read = []
    monkeypatch.setattr(parquet_footer._Reader, "_byte", lambda self, inner=parquet_footer._Reader._byte: (read.append(1), inner(self))[1])
    with pytest.raises(ValueError, match=r"^x: not a Parquet file that can be read: its footer is damaged$"):
        parquet_footer.read(Path("x"), footer(content))
    assert len(read) < 10_100


def varint(number):
    out = b""
    while number > 127:
        out, number = out + bytes([number & 127 | 128]), number >> 7
    return out + bytes([number])


def with_page(path, packed, unpacked, stated):
    """A file of one column whose only page has these packed bytes, the size `unpacked` in its header and `stated` in the footer."""
    schema = pa.schema([pa.field("x", pa.int64(), nullable=False)])
    pq.write_table(pa.table({"x": np.arange(1000)}, schema), path, compression="GZIP", use_dictionary=False, write_statistics=False)
    content, column = path.read_bytes(), pq.read_metadata(path).row_group(0).column(0)
    begin, size = column.data_page_offset, column.total_compressed_size
    end = content[begin : begin + size].index(b"\x1f\x8b")  # of the header
    head = content[begin : begin + end]
    sizes = [varint(2 * n) for n in (column.total_uncompressed_size - end, size - end)]
    page = head.replace(b"\x15" + sizes[0] + b"\x15" + sizes[1], b"\x15" + varint(2 * unpacked) + b"\x15" + varint(2 * len(packed)))
    about = content[begin + size : -8]
    old = b"\x16" + varint(2 * column.total_uncompressed_size) + b"\x16" + varint(2 * size)
    assert about.count(old) == 1 and page != head
    about = about.replace(old, b"\x16" + varint(2 * stated) + b"\x16" + varint(2 * (len(page) + len(packed))))
    path.write_bytes(content[:begin] + page + packed + about + struct.pack("<I", len(about)) + b"PAR1")


def test_the_sizes_of_pages_are_known_whatever_the_footer_states(tmp_path):
    """Before, a file of 1 MB whose footer stated 8 kB made Arrow unpack a page of 1 GB."""
    path, size = tmp_path / "x.parquet", 1 << 20
    data = np.arange(1000).tobytes()
    with_page(path, gzip.compress(data + bytes(size - len(data))), size, 8000)
    with open(path, "rb") as file:
        assert parquet_footer.read(path, file).bytes == size
    assert pq.read_table(path)["x"].to_pylist()[-1] == 999
    changed = bytearray(path.read_bytes())
    changed[4:8] = b"\xff" * 4
    path.write_bytes(changed)
    with open(path, "rb") as file, pytest.raises(ValueError, match="the header of a page is damaged"):
        parquet_footer.read(path, file)


def test_more_than_the_limits_is_an_error(tmp_path, monkeypatch):
    path = tmp_path / "index.parquet"
    pq.write_table(pa.table(ROW), path)
    monkeypatch.setattr(index, "_TABLE_BYTES", 100)
    with pytest.raises(ValueError, match=r"index\.parquet has \d+ bytes when it is unpacked, more than 100$"):
        index.rows_of(path)
    monkeypatch.setattr(parquet_footer, "_MAX_HEADERS", 100)
    with pytest.raises(ValueError, match=r"the headers of its pages have more than 100 bytes$"):
        index.rows_of(path)
