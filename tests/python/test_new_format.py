# SPDX-License-Identifier: Apache-2.0
"""A new export format is a module, lines_format.py, and a line in it: everything that exports knows the format then."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import mjsense as mjs
from mjsense.exporting.formats import FORMATS, OPTIONS, module_of

EXPORT = "import sys, lines_format, mjsense.__main__ as program; sys.exit(program.main())"


@pytest.fixture(scope="module", autouse=True)
def lines_format():
    import lines_format

    yield lines_format
    del FORMATS["lines"], sys.modules["lines_format"]  # other tests go through all formats


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Five episodes of 5 observations."""
    out = tmp_path_factory.mktemp("lines") / "data"
    mjs.record("pick", out=out, num_worlds=5, num_attempts=5, keep_failures=True, cameras=[], horizon=4)
    return out


def program(*words):
    done = subprocess.run([sys.executable, "-c", EXPORT, *map(str, words)], cwd=Path(__file__).parent, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_function(data, tmp_path):
    shown = []
    out = mjs.export(data, tmp_path / "a", format="lines", episodes=[1, 3], progress=lambda *now: shown.append(now))
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    assert [(line["episode"], line["steps"]) for line in lines] == [(1, 4), (3, 4)] and shown == [(1, 2), (2, 2)]
    assert lines[0]["action"] == mjs.exporting.Source(data).rows(mjs.Dataset(data).episodes[1])["action"].tolist()
    assert list(tmp_path.iterdir()) == [out]


def test_command(data, tmp_path):
    assert program("export", "lines", data, tmp_path / "a", "--no-trim-idle") == (0, f"Wrote {tmp_path / 'a'}.\n", "")
    assert (tmp_path / "a").read_text() == mjs.export(data, tmp_path / "b", format="lines").read_text()
    code, text, _ = program("export", "--help")
    assert code == 0 and "one line for each episode" in " ".join(text.split())
    code, _, error = program("export", "lines", data, tmp_path / "c", "--exact-rate")
    assert code == 2 and error.endswith("--exact-rate is an option of the formats lerobot and lerobot21\n")


def test_cluster(data, tmp_path, monkeypatch):
    ray = pytest.importorskip("ray")
    from mjsense.cluster import export_on_ray, exporting

    monkeypatch.setattr(exporting, "_CHUNK", 2)  # three parts
    folder = {"env_vars": {"PYTHONPATH": f"{Path(mjs.__file__).parents[1]}:{Path(__file__).parent}:{':'.join(sys.path)}"}}
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR", runtime_env=folder)
    try:
        shown = []
        ours = export_on_ray(data, tmp_path / "a", format="lines", progress=lambda *now: shown.append(now))
        assert ours.read_text() == mjs.export(data, tmp_path / "b", format="lines").read_text() and shown == [(2, 5), (4, 5), (5, 5)]
    finally:
        ray.shutdown()


def test_mistakes(data, tmp_path, monkeypatch, lines_format):
    with pytest.raises(ValueError, match="unknown export format 'line'; did you mean 'lines'"):
        mjs.export(data, tmp_path / "a", format="line")
    with pytest.raises(ValueError, match=r"^encode_again is an option of the format mcap$"):
        mjs.export(data, tmp_path / "a", format="lines", encode_again=True)
    with pytest.raises(TypeError, match=r"export\(\) got an unexpected keyword argument 'trimidle'; did you mean 'trim_idle'"):
        mjs.export(data, tmp_path / "a", format="lines", trimidle=True)
    with pytest.raises(ValueError, match="format 'lines' cannot be written during a recording, only lerobot: record first"):
        mjs.record("pick", out=tmp_path / "a", format="lines")
    monkeypatch.setattr(lines_format, "write", lambda source, path, progress: path.write_text("half") // 0)
    with pytest.raises(ZeroDivisionError):
        mjs.export(data, tmp_path / "a", format="lines")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_a_module_and_a_function(name):
    module, format = module_of(name), FORMATS[name]
    assert callable(module.write) and set(format.options) <= OPTIONS.keys()
    assert hasattr(module, "join") or name.startswith("lerobot")
    assert hasattr(module, "Writer") == format.while_recording
