# SPDX-License-Identifier: Apache-2.0
"""tests/summary.py, the summary at the end of ./dev test."""

import subprocess
import sys
from pathlib import Path

SUMMARY = Path(__file__).parents[1] / "summary.py"
GTEST = """<testsuites><testsuite><testcase name="a"/><testcase name="b">
<skipped message="x_test.cc:12&#x0A;no OpenGL here"/></testcase>{more}</testsuite></testsuites>"""
PYTEST = """<testsuites><testsuite><testcase name="c"/><testcase name="d"><skipped type="pytest.skip" message="no ffprobe"/>
</testcase><testcase name="e"><skipped type="pytest.skip" message="no ffprobe"/></testcase></testsuite></testsuites>"""


def summary(folder, more=""):
    (folder / "rays_test.xml").write_text(GTEST.format(more=more))
    (folder / "pytest.xml").write_text(PYTEST)
    return subprocess.run([sys.executable, SUMMARY, folder], capture_output=True, text=True)


def test_counts_and_reasons(tmp_path):
    done = summary(tmp_path)
    assert done.returncode == 0
    assert done.stdout.splitlines() == [
        "C++: 1 passed, 0 failed, 1 skipped", "  1 x no OpenGL here", "Python: 1 passed, 0 failed, 2 skipped", "  2 x no ffprobe"
    ]  # fmt: skip


def test_failures_are_reported(tmp_path):
    done = summary(tmp_path, '<testcase name="f"><failure message="1 is not 2"/></testcase>')
    assert done.returncode == 1 and "C++: 1 passed, 1 failed" in done.stdout


def test_no_reports_are_a_failure(tmp_path):
    assert subprocess.run([sys.executable, SUMMARY, tmp_path], capture_output=True).returncode == 1
