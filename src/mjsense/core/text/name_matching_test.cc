// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/text/name_matching.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<std::string> kNames = {"FR_foot", "FL_foot", "RR_foot", "trunk", "FR_calf"};

TEST(Match, MatchesFullNamesInModelOrder) {
  const std::vector<std::string> patterns = {".*_calf", "F._foot"};
  EXPECT_THAT(match_names(patterns, kNames, "sensor 'feet'"), ElementsAre(0, 1, 4));
  EXPECT_THAT(match_names(std::vector<std::string>{"(?!R).*_foot"}, kNames, "x"),
              ElementsAre(0, 1));
}

std::string fault(const std::vector<std::string>& patterns) {
  return error_of<ValueError>([&] { match_names(patterns, kNames, "sensor 'feet'"); });
}

TEST(Match, ErrorsNameThePattern) {
  EXPECT_EQ(fault({"foot"}),
            "sensor 'feet': Not all regular expressions are matched: 'foot' matches no name; did "
            "you mean 'FR_foot', 'FL_foot' or "
            "'RR_foot'?");
  EXPECT_EQ(fault({"FR.*", ".*_foot"}),
            "sensor 'feet': Multiple matches for 'FR_foot': the patterns 'FR.*' and '.*_foot'");
  EXPECT_EQ(fault({"FR_(foot"}),
            "sensor 'feet': 'FR_(foot' is not a regular expression: missing closing parenthesis at "
            "position 8");
  EXPECT_THAT(fault({"*"}),
              HasSubstr("a quantifier without an expression before it at position 0"));
  EXPECT_THAT(fault({"a**"}),
              HasSubstr("a quantifier without an expression before it at position 2"));
  EXPECT_THAT(fault({"\\h"}), HasSubstr("not supported: \\h at position 0"));
}

TEST(Match, ExcludeSearchesOrCompares) {
  const Exclude exclude(std::vector<std::string>{"trunk", "_cal.$"}, "x");
  EXPECT_TRUE(exclude.drops("trunk"));
  EXPECT_FALSE(exclude.drops("trunk_2"));
  EXPECT_TRUE(exclude.drops("FR_calf"));
  EXPECT_FALSE(exclude.drops("FR_calf_2"));
}

std::string refusal(const std::string& pattern) {
  return error_of<ValueError>([&] { Regex regex(pattern, "x"); });
}

// Syntax that PCRE2 interprets differently from Python must be rejected.
TEST(Match, RejectsPatternsThatDifferFromPython) {
  for (const char* pattern :
       {"[[:a]",  "a{,2}b",         "a{}",     "\\u00e9", "\\N{DIGIT ONE}", "a\\Z",    "(?x) a b",
        "(a)\\1", "(?P<n>a)(?P=n)", "\\v",     "(?a)\\w", "(?(1)a|b)",      "\\101",   "\\0",
        "a(?i)b", "(?-i:a)",        "\\Qa\\E", "(?|a|b)", "(*UTF)a",        "[\\w-a]", "\\h",
        "\\x4"}) {
    EXPECT_THAT(refusal(pattern), HasSubstr("not supported")) << pattern;
  }
  for (const char* pattern : {"^*", "$?", "\\b+", "a|*", "a{2}{3}"}) {
    EXPECT_THAT(refusal(pattern), HasSubstr("a quantifier without an expression before it"))
        << pattern;
  }
  EXPECT_EQ(refusal("FR_\\Z"),
            "x: 'FR_\\Z' is not a regular expression: not supported: \\Z at position 3");
}

TEST(Match, HasPythonSemantics) {
  const auto full = [](const char* pattern, std::string_view text) {
    return Regex(pattern).fullmatch(text);
  };
  EXPECT_TRUE(full("é+", "éé"));
  EXPECT_TRUE(full("\\w+", "bras_été_3"));
  EXPECT_TRUE(full("a$\\n", "a\n"));
  EXPECT_TRUE(full("a|ab", "ab"));  // fullmatch tries further alternatives after the first
  EXPECT_TRUE(full("(?i)foot", "FOOT"));
  EXPECT_TRUE(full("(?i:f)oot", "Foot"));
  EXPECT_FALSE(full("foot", "Foot"));
  EXPECT_TRUE(full("[]a\\[-]+", "]a[-"));
}

// 10,000 random lists of patterns, compared with Python's `re`: the matched names, and which lists
// are errors.
constexpr const char* kOracle = R"py(
import random, re, sys, warnings
warnings.simplefilter("ignore")
rng = random.Random(int(sys.argv[1]))
words = ["FR", "FL", "RR", "RL", "foot", "calf", "hip", "_", "_", "0", "1", "12", "link", "é", "ß", "左", "/", "-", ".", " ", "A", "a"]
atoms = ["F", "R", "L", "foot", "calf", "hip", "_", "0", "1", ".", ".", ".*", r"\d", r"\w", r"\s", r"\D", r"\W", r"\S", r"\.", r"\-", r"\_",
         "é", "左", r"\u00e9", r"\xe9", r"\x41", "[FR]", "[^L]", "[a-f]", r"[\w-]", "[]a]", "[^]a]", "[[:alpha:]]", r"[\d_]", "[F-R0-9]", "[a-]",
         "{", "{}", "}", "]", "{a", r"\t", r"\\", "/", "-", r"\101", r"\0", "[.*+]", "[|&]", r"[\b]", r"[\101]", "#", " "]
anchors = ["^", "$", r"\A", r"\Z", r"\b"]
quants = ["*", "+", "?", "{2}", "{1,2}", "{,2}", "{1,}", "*?", "+?", "??", "{0,2}?", "{,}"]
if sys.version_info >= (3, 11): quants += ["*+", "++", "?+"]

# Half of the lists keep to what is supported; the others may be refused.
beyond = {r"\u00e9", "[[:alpha:]]", "{", "{}", "{a", r"\101", r"\0", r"[\101]", r"\Z", "{,2}", "{,}"}
inside = False

def choose(choices):
    return rng.choice([c for c in choices if not (inside and c in beyond)])

def piece(depth, state):
    x = rng.random()
    if depth > 0 and x < .3:
        body = alternation(depth - 1, state)
        kind = rng.choice(["(", "(", "(?:", "(?=", "(?!", "(?P<", "(?i:", "(?s-i:", "(?<=", "(?<!", "(?#", "(?>"])
        if kind == "(?s-i:" and inside: kind = "(?s:"
        if kind == "(?#": return "" if inside else "(?#comment)"
        if kind == "(?>" and sys.version_info < (3, 11): kind = "(?:"
        if kind in ("(?<=", "(?<!"): return kind + rng.choice(["F", "_", "[FR]", "foot", r"\w", "a|b"]) + ")"
        if kind == "(": state[0] += 1
        if kind == "(?P<":
            state[0] += 1; state[1] += 1
            kind = "(?P<n%d>" % state[1]
        return kind + body + ")"
    if x < .36: return choose(anchors)
    if x < .40 and state[0] and not inside: return "\\%d" % rng.randint(1, state[0])
    if x < .42 and state[1] and not inside: return "(?P=n%d)" % rng.randint(1, state[1])
    if x < .43 and state[0] and not inside: return "(?(%d)%s|%s)" % (rng.randint(1, state[0]), rng.choice(atoms), rng.choice(atoms))
    return choose(atoms)

def sequence(depth, state):
    out = ""
    for _ in range(rng.randint(0 if depth < 2 else 1, 4)):
        out += piece(depth, state)
        if rng.random() < .25: out += choose(quants)
    return out

def alternation(depth, state):
    return "|".join(sequence(depth, state) for _ in range(rng.choice([1, 1, 1, 2, 3])))

def name(): return "".join(rng.choice(words) for _ in range(rng.randint(1, 5)))

def pattern(names):
    x = rng.random()
    if x < .25:  # derived from a name, so that it matches
        n = rng.choice(names)
        k = rng.randint(0, len(n))
        return re.escape(n[:k]) + rng.choice([".*", r"\w*", "[^/]*", "(?:.|)+", ".*?"]) + choose(["", "$", r"\Z"])
    if x < .35: return "(.*_)?" + rng.choice(["foot", "calf", "hip|link", "(?!foot).*", r"\d+"]) + rng.choice(["", ".*"])
    if x < .40 and not inside: return "".join(rng.choice("()[]{}?*+|\\^$.aF_0-:!=<P>#") for _ in range(rng.randint(1, 7)))  # mostly errors
    return rng.choice(["", "", "", "(?i)", "(?s)"] + ([] if inside else ["(?x)", "(?a)"])) + alternation(2, [0, 0])

def expected(patterns, names, excludes):
    found, used = [], set()
    for i, n in enumerate(names):
        hits = [k for k, p in enumerate(patterns) if re.fullmatch(p, n)]
        if len(hits) > 1: return "error"
        used.update(hits)
        if hits: found.append(i)
    if len(used) < len(patterns): return "error"
    special = set(".*+?[]{}()\\|^$")
    for e in excludes:
        test = (lambda n: re.search(e, n)) if special & set(e) else (lambda n: n == e)
        found = [i for i in found if not test(names[i])]
    return " ".join(map(str, found))

# Possessive quantifiers and atomic groups are new in Python 3.11 and matched wrongly before 3.11.5 (gh-106052).
def beyond_this_python(strings):
    new = re.compile(r"[*+?}]\+|\(\?>")
    return sys.version_info < (3, 11, 5) and any(new.search(s) for s in strings)

def code(strings): return ",".join("x" + s.encode().hex() for s in strings)
for _ in range(int(sys.argv[2])):
    inside = not inside
    while True:
        names = [name() for _ in range(rng.randint(1, 8))]
        patterns = [pattern(names) for _ in range(rng.choice([1, 1, 1, 2]))]
        excludes = [rng.choice([pattern(names), rng.choice(names)]) for _ in range(rng.choice([0, 0, 1]))]
        if not beyond_this_python(patterns + excludes): break
    try:
        for e in patterns + excludes: re.compile(e)
        result = expected(patterns, names, excludes)
    except (re.error, OverflowError) as error:
        result = "syntax"
    print(code(patterns), code(names), code(excludes) or "-", result, "inside" if inside else "any", sep="\t")
)py";

std::vector<std::string> decode(const std::string& text) {
  std::vector<std::string> strings;
  if (text == "-") return strings;
  std::stringstream in(text);
  for (std::string part; std::getline(in, part, ',');) {
    std::string bytes;
    for (std::size_t i = 1; i < part.size(); i += 2)
      bytes += static_cast<char>(std::stoi(part.substr(i, 2), nullptr, 16));
    strings.push_back(bytes);
  }
  return strings;
}

std::string ours(const std::vector<std::string>& patterns, const std::vector<std::string>& names,
                 const std::vector<std::string>& excludes) {
  try {
    for (const auto& p : patterns) Regex{p};
    const Exclude exclude(excludes, "test");
    std::string out;
    for (int i : match_names(patterns, names, "test")) {
      if (!exclude.drops(names[i])) out += fmt::format("{}{}", out.empty() ? "" : " ", i);
    }
    return out;
  } catch (const ValueError& error) {
    const std::string_view what = error.what();
    if (what.find("not supported: a quantifier without an expression before it") != what.npos)
      return "syntax";
    if (what.find("not supported") != what.npos) return "unsupported";
    return what.find("is not a regular expression") != what.npos ? "syntax" : "error";
  }
}

TEST(Match, RandomListsMatchPython) {
  const testing::TempDir dir;
  const std::string script = dir.file("oracle.py");
  std::ofstream(script) << kOracle;
  const char* given = std::getenv("MJSENSE_MATCH_SEED");
  const std::string seed = given ? given : "1";
  FILE* python = popen(("python3 '" + script + "' " + seed + " 10000").c_str(), "r");
  ASSERT_NE(python, nullptr);
  std::string text;
  char buffer[1 << 16];
  while (const std::size_t n = std::fread(buffer, 1, sizeof buffer, python)) text.append(buffer, n);
  if (pclose(python) != 0) GTEST_SKIP() << "no python3";
  std::stringstream lines(text);
  int total = 0, matched = 0, syntax = 0, unsupported = 0, faults = 0;
  for (std::string line; std::getline(lines, line); ++total) {
    std::stringstream columns(line);
    std::string patterns, names, excludes, expected, subset;
    std::getline(columns, patterns, '\t');
    std::getline(columns, names, '\t');
    std::getline(columns, excludes, '\t');
    std::getline(columns, expected, '\t');
    std::getline(columns, subset);
    const std::string got = ours(decode(patterns), decode(names), decode(excludes));
    if (expected == "syntax") ++syntax;
    if (expected != "syntax" && expected != "error" && !expected.empty()) ++matched;
    if (got == "unsupported" && (subset == "any" || expected == "syntax")) {
      ++unsupported;
      continue;
    }
    if (got != expected && ++faults <= 20) {
      ADD_FAILURE() << fmt::format("python '{}' ours '{}'", expected, got) << " patterns "
                    << ::testing::PrintToString(decode(patterns)) << " names "
                    << ::testing::PrintToString(decode(names)) << " exclude "
                    << ::testing::PrintToString(decode(excludes));
    }
  }
  EXPECT_EQ(total, 10000);
  EXPECT_EQ(faults, 0);
  EXPECT_GT(matched, 1500);
  EXPECT_GT(syntax, 300);
  EXPECT_LT(unsupported, 5000);
}

}  // namespace
}  // namespace mjsense
