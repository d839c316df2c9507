# SPDX-License-Identifier: Apache-2.0
"""tools/check_rooms.py: which includes and namespaces it reports."""

import importlib.util
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("check_rooms", Path(__file__).parents[2] / "tools/check_rooms.py")
check_rooms = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_rooms)

ORDER = {room: i for i, room in enumerate(("mjsense/core", "mjsense/rays", "mjsense/sim", "mjsense_tasks/robots", "mjsense_tasks/tasks"))}


def block(name, body):
    return f"namespace {name} {{\n{body}\n}}  // namespace {name}\n"


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("mjsense/rays/a.cc", block("mjsense", "int f() { return 1; }")),
        ("mjsense/rays/a_test.cc", block("mjsense::sim", "int f();")),
        ("mjsense/rays/a.h", block("mjsense::rays", "") + block("mjsense::sim", "class A;\nint f();")),
        ("mjsense/rays/a.h", block("mjsense::testing", "int f();")),
        ("mjsense/core/a.h", block("mjsense::rays", "int f();")),
        ("mjsense/core/a.h", block("mjsense::tasks", "int f();")),
        ("mjsense_tasks/robots/a.h", block("mjsense::tasks", "int f();")),
        ("mjsense_tasks/tasks/a.h", block("mjsense::tasks::robots", "int f();")),
    ],
)
def test_another_namespace_is_reported(path, text):
    (message,) = check_rooms.wrong_namespaces(Path(path), text, ORDER)
    assert message.startswith(f"{path}: defines names in namespace mjsense")


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("mjsense/rays/a.h", block("mjsense::sim", "class A;\nstruct B;") + block("mjsense::rays", "int f();")),
        ("mjsense/rays/a.h", block("mjsense", "template <>\nstruct Type<rays::A> {};") + block("mjsense::rays::inner", "int f();")),
        ("mjsense/rays/testing/a.h", block("mjsense::testing", "int f();")),
        ("mjsense_tasks/robots/a.h", block("mjsense::tasks::robots", "int f();")),
        ("mjsense_tasks/tasks/a.h", block("mjsense::tasks", "int f();") + block("mjsense::tasks::inner", "int f();")),
        ("mjsense/core/a.h", block("mjsense::os", "int f();") + block("mjsense", "int f();")),
    ],
)
def test_the_namespace_of_the_room_and_declarations_are_not_reported(path, text):
    assert check_rooms.wrong_namespaces(Path(path), text, ORDER) == []


@pytest.mark.parametrize(
    ("path", "include", "message"),
    [
        ("mjsense/rays/a.h", "mjsense/sim/simulation.h", "mjsense/rays/ must not depend on mjsense/sim/"),
        ("mjsense/sim/a.h", "mjsense_tasks/robots/robot.h", "mjsense/sim/ must not depend on mjsense_tasks/robots/"),
        ("mjsense/sim/a_test.cc", "mjsense_tasks/robots/robot.h", "mjsense/sim/ must not depend on mjsense_tasks/robots/"),
        ("mjsense_tasks/robots/a.h", "mjsense_tasks/tasks/pick.h", "mjsense_tasks/robots/ must not depend on mjsense_tasks/tasks/"),
        ("mjsense/sim/a.h", "mjsense/robots/robot.h", "room 'mjsense/robots' is not in docs/architecture.md"),
    ],
)
def test_an_include_of_a_later_room_is_reported(path, include, message):
    assert check_rooms.wrong_includes(Path(path), f'#include "{include}"\n', ORDER) == [f"{path}: includes {include}: {message}"]


def test_includes_of_earlier_rooms_and_those_of_tests_are_not_reported():
    text = '#include "mjsense/core/error.h"\n#include "mjsense/sim/simulation.h"\n'
    assert check_rooms.wrong_includes(Path("mjsense/rays/a_test.cc"), text, ORDER) == []
    assert check_rooms.wrong_includes(Path("mjsense_tasks/robots/a.h"), text, ORDER) == []


def test_repository_follows_the_rules():
    assert check_rooms.main() == 0
