# SPDX-License-Identifier: Apache-2.0
"""Runs the executable cases and checks |x - v| <= atol + rtol |v|; integers and shapes must be equal. Where mjlab and MuJoCo
differ, the expected value is MuJoCo's."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import run_cases


def cases(name):
    return [json.loads(line) for line in (HERE / name).read_text().splitlines() if line.strip()]


def check(found, expected):
    if expected is None:
        assert found is None
    elif "v" in expected or "only" in expected:
        assert found is not None, "absent"
        assert list(found["shape"]) == expected["shape"]
        value = np.asarray(found["v"]).ravel()
        if "only" in expected:
            assert not value.reshape(expected["shape"])[0].any()
        elif "rtol" in expected:
            np.testing.assert_allclose(value.astype(float), expected["v"], rtol=expected["rtol"], atol=expected["atol"])
        else:
            np.testing.assert_array_equal(value, expected["v"])
    elif isinstance(expected["value"], dict):
        check(found, expected["value"])
    else:
        assert found == expected["value"]


@pytest.mark.parametrize("case", cases("scene_sensors.jsonl"), ids=lambda case: case["id"])
def test_case(case):
    if "expect_error" in case:
        with pytest.raises((ValueError, KeyError, RuntimeError, TypeError)):
            run_cases.run_case(case)
        return
    result = run_cases.run_case(case)
    for label, fields in case["expect"].items():
        for field, expected in fields.items():
            check(result[label].get(field), expected)


OTHERWISE = {
    "div-cam-ortho": "the file has no correct value; tests/python/test_cameras.py tests this case",
    "div-cam-inside": "images follow MuJoCo's renderer, which culls back faces; the value in the file is mj_ray's, which does not",
}


@pytest.mark.parametrize("case", cases("divergences.jsonl"), ids=lambda case: case["id"])
def test_divergence_follows_mujoco(case):
    if case["id"] in OTHERWISE:
        pytest.skip(OTHERWISE[case["id"]])
    result = run_cases.run_case(case)
    for key, value in case["mujoco4"].items():
        if key in ("error", "msg"):  # mjsense does not reject unnamed XML sensors but gives them a name
            assert result["n"]["value"] == ["r/sensor_0"]
            return
        label, field = key.split(".")
        expected = np.asarray(value)
        np.testing.assert_allclose(np.reshape(result[label][field]["v"], expected.shape), expected, rtol=1e-4, atol=1e-4)
