# SPDX-License-Identifier: Apache-2.0
"""Files that a user names and that are missing, directories, or of another kind: one message with the path and the nearest names."""

import pytest

import mjsense as mjs
from mjsense import commands
from mjsense.dataset.sensor_tables import sensors_of
from mjsense.exporting.mapping import Mapping
from mjsense.exporting.record_lerobot import converted


def record_with_map(path):
    with converted(path.parent / "out", map=path):
        raise AssertionError("the recording has begun")


READERS = {
    "map": (Mapping.of, "not valid TOML: "),
    "map of a recording": (record_with_map, "not valid TOML: "),
    "sensors": (sensors_of, "not valid TOML: "),
    "recording": (mjs.Dataset, "not an HDF5 file that can be read: "),
    "robomimic": (lambda path: mjs.import_robomimic(path, path.parent / "out"), "not an HDF5 file that can be read: "),
}


@pytest.mark.parametrize("name", READERS)
def test_a_wrong_file_is_named_with_what_is_wrong(name, tmp_path):
    read, of_another_kind = READERS[name]
    pytest.importorskip("h5py")
    (tmp_path / "lerobot_map.toml").write_text("state = [")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(
        FileNotFoundError, match=r"lerobt_map\.toml: no such file or directory; did you mean 'lerobot_map\.toml'\?$"
    ):
        read(tmp_path / "lerobt_map.toml")
    with pytest.raises(FileNotFoundError, match=r"map\.toml: no such file or directory; there is no directory '.*/nowhere'$"):
        read(tmp_path / "nowhere/map.toml")
    with pytest.raises((ValueError, OSError), match=rf"/lerobot_map\.toml: {of_another_kind}"):
        read(tmp_path / "lerobot_map.toml")
    if "TOML" in of_another_kind:
        with pytest.raises(ValueError, match=r"/binary\.toml: not a text file in UTF-8: invalid byte at position 0$"):
            read(tmp_path / "binary.toml")
        (tmp_path / "deep.toml").write_text("a = " + "[" * 5000)
        with pytest.raises(ValueError, match=r"/deep\.toml: not valid TOML: it is nested too deeply$"):
            read(tmp_path / "deep.toml")
    if name != "recording":  # it may be a directory
        with pytest.raises(IsADirectoryError, match=r": is a directory, not a file$"):
            read(tmp_path)


def test_the_program_prints_one_line(tmp_path, capsys):
    (tmp_path / "recorded").mkdir()
    assert commands.run(["replay", str(tmp_path / "recordd")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mjsense: ") and line.endswith("no such file or directory; did you mean 'recorded'?")
