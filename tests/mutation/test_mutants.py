# SPDX-License-Identifier: Apache-2.0
"""Which changes are drawn."""

import importlib.util
import sys
from pathlib import Path

# Under a name of its own: other folders of tests have a run.py too.
spec = importlib.util.spec_from_file_location("mutation_run", Path(__file__).parent / "run.py")
mutation = sys.modules["mutation_run"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(mutation)

CODE = """
struct Cfg { int depth = 3; };
template <class V> void visit_fields(V& v, Cfg& c) {
  v("depth", c.depth, "Depth.")
      .within(0, 9);
}
int clamped(const Cfg& c, double x, double y, std::vector<int>& out) {
  if (c.depth == 0)
    throw ValueError(fmt::format("depth is {}", c.depth + 1));
  out.reserve(c.depth + 1);
  double row[9];
  if (x < y) out.clear();
  for (int i = 0; i < c.depth; ++i)
    out.push_back(i * i);
  call(one,
       other);
  return c.depth;
}
"""


def test_what_is_drawn(tmp_path):
    """Conditions, statements and arithmetic of function bodies; no declarations, messages, reserved memory or parts of a call."""
    (tmp_path / "x.cc").write_text(CODE)
    found = {(CODE.split("\n")[site.line - 1].strip(), site.what) for site in mutation.module("draw").sites(tmp_path / "x.cc")}
    assert found == {
        ("if (c.depth == 0)", "== becomes !="),
        ("if (c.depth == 0)", "0 becomes 1"),
        ("if (x < y) out.clear();", "< becomes >="),
        ("if (x < y) out.clear();", "the condition is negated"),
        ("for (int i = 0; i < c.depth; ++i)", "0 becomes 1"),
        ("for (int i = 0; i < c.depth; ++i)", "< becomes <="),
        ("for (int i = 0; i < c.depth; ++i)", "< becomes >="),
        ("out.push_back(i * i);", "* becomes /"),
        ("out.push_back(i * i);", "a statement is removed"),
    }


def test_a_seed_draws_the_same_mutants():
    draw = mutation.module("draw").draw
    rooms = ["core", "python/dataset"]
    assert draw(mutation.ROOT, rooms, 20, 7) == draw(mutation.ROOT, rooms, 20, 7) != draw(mutation.ROOT, rooms, 20, 8)


def test_the_code_of_a_mutant_replaces_that_of_its_function():
    text = "def outer(x):\n    def inner():\n        return 1\n    return inner() if x else 2\n"
    forked, code = mutation.module("forked"), compile(text, "x.py", "exec")
    assert [forked.inner(code, line).co_name for line in (3, 4)] == ["inner", "outer"]
    variables = {}
    exec(code, variables)
    mutated = compile(text.replace("return 1", "return 7"), "x.py", "exec")
    variables["outer"].__code__ = forked.named(mutated, variables["outer"].__code__)
    assert (variables["outer"](1), variables["outer"](0)) == (7, 2)
