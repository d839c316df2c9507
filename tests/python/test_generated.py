# SPDX-License-Identifier: Apache-2.0
"""Generated files match the declarations in C++."""

import importlib.util
import inspect
import json
import pathlib

import pytest

import mjsense as mjs
from mjsense import _core
from mjsense.core.declared_fields import declared_fields

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCHEMA = json.loads(_core.schema())


def generator():
    spec = importlib.util.spec_from_file_location("generate", ROOT / "tools" / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Generator(SCHEMA)


@pytest.mark.parametrize("path, text", generator().files().items(), ids=lambda x: x.name if isinstance(x, pathlib.Path) else "")
def test_files_are_as_generated(path, text):
    assert path.read_text() == text, f"{path.relative_to(ROOT)}: run ./dev generate"


def test_every_field_has_a_description():
    for name, struct in SCHEMA["structs"].items():
        for field in struct["fields"]:
            assert field["doc"].endswith(".") and len(field["doc"]) > 4, (name, field["name"])


def test_enum_values_are_types_and_are_shown_by_help():
    assert "Literal" in str(inspect.signature(mjs.ContactSensorCfg).parameters["reduce"])
    assert "maxforce" in str(mjs.ContactSensorCfg.__doc__)
    assert "discrete" in str(mjs.MujocoCfg.__doc__)


def test_options_and_defaults_are_the_same_everywhere():
    record, make_vec = inspect.signature(mjs.record).parameters, inspect.signature(mjs.make_vec).parameters
    assert {"crf", "preset", "ffmpeg", "molmospaces_depth", "num_worlds", "action_noise"} <= set(record)
    for name in set(record) & set(make_vec) - {"policy", "action_noise", "out", "seed", "episodes"}:
        assert record[name].default == make_vec[name].default, name
    for function in (mjs.Recorder, mjs.RecordEpisodes.__init__, mjs.play, mjs.import_robomimic, mjs.import_lerobot):
        parameters = inspect.signature(function).parameters
        assert {"batches", "gzip", "crf", "preset", "tune", "keyint"} <= parameters.keys(), function
        for name in parameters.keys() & declared_fields("FilesCfg").keys() - {"episodes"}:
            finer = name == "crf" and function is mjs.import_lerobot
            assert parameters[name].default == (18 if finer else record[name].default), (function, name)
    for name in inspect.signature(mjs.render).parameters.keys() & (declared_fields("ImageCfg") | declared_fields("VideoCfg")).keys() - {"ffmpeg"}:
        assert inspect.signature(mjs.render).parameters[name].default is None, name
    assert record["seed"].default == 0 and make_vec["seed"].default is None  # a recording is reproducible, an environment draws entropy
