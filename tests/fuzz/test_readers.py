# SPDX-License-Identifier: Apache-2.0
"""Each reader of untrusted files in Python with a few inputs, which are always the same. ``./dev fuzz`` runs them for longer."""

import sys
from pathlib import Path

import pytest

for module in ("hypothesis", "av", "pyarrow", "viser", "msgpack"):
    pytest.importorskip(module)
sys.path.insert(0, str(Path(__file__).parent))
import untrusted_readers as readers


@pytest.mark.parametrize("name", readers.READERS)
def test_a_reader_gives_a_value_or_one_clear_error(name):
    readers.test_of(name, 60, same=True)()
