# SPDX-License-Identifier: Apache-2.0
"""mjsense.cluster.scratch: temporary folders of processes that were killed are removed, those of others stay."""

import contextlib
import subprocess
import sys
import tempfile
from pathlib import Path

from mjsense.cluster.scratch import scratch_folder

HOLD = """
from mjsense.cluster.scratch import scratch_folder
with scratch_folder() as folder:
    (folder / "file").touch()
    print(folder, flush=True)
    input()
"""


def folders(path):
    return {entry for entry in path.iterdir() if entry.is_dir() and not entry.is_symlink()}


def test_folders_of_killed_processes_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    hold = [sys.executable, "-c", HOLD]
    with contextlib.ExitStack() as stack:
        killed, running = (stack.enter_context(subprocess.Popen(hold, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)) for _ in range(2))
        assert killed.stdout and running.stdout
        left, used = (Path(process.stdout.readline().strip()) for process in (killed, running))
        (tmp_path / "mjsense_task_link").symlink_to(tmp_path)
        killed.kill()
        killed.wait()
        assert folders(tmp_path) == {left, used}
        with scratch_folder() as folder:
            assert folders(tmp_path) == {used, folder}
        running.communicate("\n")
        assert [path.name for path in tmp_path.iterdir()] == ["mjsense_task_link"]
