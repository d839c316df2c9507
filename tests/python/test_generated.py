# SPDX-License-Identifier: Apache-2.0
"""Generated files match the declarations in C++."""

import importlib.util
import inspect
import json
import pathlib

import pytest

import mjsense as mjs
from mjsense import _core

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
    for name in set(record) & set(make_vec) - {"policy", "action_noise", "out", "seed"}:
        assert record[name].default == make_vec[name].default, name
    assert record["seed"].default == 0 and make_vec["seed"].default is None  # a recording is reproducible, an environment draws entropy
