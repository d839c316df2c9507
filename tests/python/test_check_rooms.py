# SPDX-License-Identifier: Apache-2.0
"""tools/check_rooms.py: which includes and namespaces it reports."""

import importlib.util
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("check_rooms", Path(__file__).parents[2] / "tools/check_rooms.py")
check_rooms = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_rooms)

ORDER = {"core": 0, "rays": 1, "sim": 2}


def block(name, body):
    return f"namespace {name} {{\n{body}\n}}  // namespace {name}\n"


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("rays/a.cc", block("mjsense", "int f() { return 1; }")),
        ("rays/a_test.cc", block("mjsense::sim", "int f();")),
        ("rays/a.h", block("mjsense::rays", "") + block("mjsense::sim", "class A;\nint f();")),
        ("rays/a.h", block("mjsense::testing", "int f();")),
        ("core/a.h", block("mjsense::rays", "int f();")),
    ],
)
def test_another_namespace_is_reported(path, text):
    (message,) = check_rooms.wrong_namespaces(Path(path), text, ORDER)
    assert message.startswith(f"{path}: defines names in namespace mjsense")


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("rays/a.h", block("mjsense::sim", "class A;\nstruct B;") + block("mjsense::rays", "int f();")),
        ("rays/a.h", block("mjsense", "template <>\nstruct Type<rays::A> {};") + block("mjsense::rays::inner", "int f();")),
        ("rays/testing/a.h", block("mjsense::testing", "int f();")),
        ("core/a.h", block("mjsense::os", "int f();") + block("mjsense", "int f();")),
    ],
)
def test_the_namespace_of_the_room_and_declarations_are_not_reported(path, text):
    assert check_rooms.wrong_namespaces(Path(path), text, ORDER) == []


def test_an_include_of_a_later_room_is_reported():
    assert check_rooms.wrong_includes(Path("rays/a.h"), '#include "mjsense/sim/simulation.h"\n', ORDER) == [
        "rays/a.h: includes mjsense/sim/simulation.h: rays/ must not depend on sim/"
    ]


def test_repository_follows_the_rules():
    assert check_rooms.main() == 0
