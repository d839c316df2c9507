# SPDX-License-Identifier: Apache-2.0
"""tools/check_names.py: what counts as two definitions of one name."""

import importlib.util
import sys
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("check_names", Path(__file__).parents[2] / "tools/check_names.py")
check_names = sys.modules["check_names"] = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_names)


def found(first, second):
    files = {"a.cc": first, "b.cc": second}
    definitions = [d for name, text in files.items() for d in check_names.definitions(f"namespace mjsense {{\n{text}\n}}\n", name)]
    return check_names.duplicates(definitions)


@pytest.mark.parametrize(
    ("first", "second", "name"),
    [
        ("class House { int a; };", "struct House { double b; };", "type House"),
        ("struct Look final : Base<int> {};", "template <class T> struct Look {};", "type Look"),
        ("enum class Kind : char { kA };", "struct Kind {};", "type Kind"),
        ("struct R::Impl { int a; };", "struct R::Impl { int b; };", "type R::Impl"),
        ("inline int f(const A& a, int n = 3) { return n; }", "int f(A const& b, int) { return 1; }", "f(A &, int)"),
        ("int f(std::vector<A, B> x) { return {}; }", "int f(std::vector<A, B>) { return 1; }", "f(vector < A , B >)"),
        ("int X::g() const { return 1; }", "int X::g() const { return 2; }", "X::g() const"),
        ("X::X(int a) : a_{a}, b_(a) {}", "X::X(int) {}", "X::X(int)"),
        ("inline constexpr double kA[2] = {1, 2};", "int kA = 3;", "variable kA"),
    ],
)
def test_duplicate_definitions_are_found(first, second, name):
    assert found(first, second) == [f"mjsense::{name} is defined in a.cc:2 and b.cc:2"]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("class House;", "struct House { double b; };"),
        ("namespace { struct House {}; }", "struct House { double b; };"),
        ("namespace a { struct House {}; }", "namespace b { struct House {}; }"),
        ("struct A { struct House {}; };", "struct B { struct House {}; };"),
        ("static int f(int a) { return a; }", "int f(int a) { return a; }"),
        ("int f(int a) { return a; }", "int f(double a) { return a; }"),
        ("int f(const A& a, const B& b = {});", "int f(const A& a, const B& b) { return 1; }"),
        ("void g() { struct House {}; }", "struct House {};"),
        ("constexpr int kA = 1;", "constexpr int kA = 2;"),
        ("extern int kA;", "int kA = 2;"),
        ("template <> inline constexpr int kWords<A>{1};", "template <> inline constexpr int kWords<B>{2};"),
        ('const char* const text = "struct House {"; // struct House {', "struct House {};"),
    ],
)
def test_other_definitions_are_not_reported(first, second):
    assert found(first, second) == []


def test_repository_has_no_duplicate_definitions():
    assert check_names.main([]) == 0
