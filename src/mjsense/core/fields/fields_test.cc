// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"

namespace mjsense {

enum class Side { kLeft, kRight };
constexpr std::array<std::string_view, 2> enum_names(Side) { return {"left", "right"}; }

namespace fields_test {

struct Wheel {
  double radius = 0.1;
  float width = 0.9f;
};
template <class V>
void visit_fields(V& v, Wheel& c) {
  v.object("Wheel", "A wheel.", "wheel");
  v("radius", c.radius, "From hub to rim.").unit("m").positive();
  v("width", c.width, "Across.").unit("m");
}
struct Leg {
  int joints = 3;
};
template <class V>
void visit_fields(V& v, Leg& c) {
  v.object("Leg", "A leg.", "leg");
  v("joints", c.joints, "How many.").within(1, 7);
}

struct Base {
  virtual ~Base() = default;
  std::string name;
};
template <class V>
void visit_fields(V& v, Base& c) {
  v.object("Base", "What all have.");
  v("name", c.name, "Its name.").required();
}

struct Cfg : Base {
  Side side = Side::kRight;
  std::vector<std::string> marks{"a"};
  std::optional<int> steps;
  std::array<double, 3> pos{0, 0, 1};
  std::variant<Wheel, Leg> foot;
  std::vector<std::pair<std::string, Wheel>> spares;
  double reach = std::numeric_limits<double>::infinity();
  std::uint64_t seed = 0;
  bool on = true;
};
constexpr std::array<std::string_view, 2> kMarks{"a", "b"};
template <class V>
void visit_fields(V& v, Cfg& c) {
  v.object("Cfg", "All that can stand in one.", "cfg");
  v.extends(static_cast<Base&>(c));
  v("side", c.side, "Which hand.");
  v("marks", c.marks, "Of a and b.").one_of(kMarks).not_empty();
  v("steps", c.steps, "How many, if any.").at_least(1);
  v("pos", c.pos, "Where.").unit("m");
  v("foot", c.foot, "What it stands on.");
  v("spares", c.spares, "Wheels by name.");
  v("reach", c.reach, "How far.").may_be_infinite();
  v("seed", c.seed, "Of random numbers.");
  v("on", c.on, "Whether at all.");
}

template <class Change>
std::string fault(Change&& change) {
  Cfg cfg;
  change(cfg);
  return error_of<ValueError>([&] { check_fields(cfg, "sensor 'x'"); });
}

TEST(Fields, EveryValueIsChecked) {
  const double nan = std::nan("");
  EXPECT_EQ(fault([](Cfg&) {}), "");
  EXPECT_EQ(fault([](Cfg& c) { c.steps = 0; }), "sensor 'x': steps is 0: must be at least 1");
  EXPECT_EQ(fault([&](Cfg& c) { c.pos[1] = nan; }), "sensor 'x': pos[1] is nan: must be finite");
  EXPECT_EQ(fault([&](Cfg& c) { c.pos[1] = INFINITY; }),
            "sensor 'x': pos[1] is inf: must be finite");
  EXPECT_EQ(fault([&](Cfg& c) { c.reach = nan; }), "sensor 'x': reach is nan: must be a number");
  EXPECT_EQ(fault([&](Cfg& c) { c.foot = Wheel{0}; }),
            "sensor 'x': foot: radius is 0: must be above 0");
  EXPECT_EQ(fault([&](Cfg& c) { c.foot = Leg{8}; }),
            "sensor 'x': foot: joints is 8: must be between 1 and 7");
  EXPECT_EQ(fault([&](Cfg& c) {
              c.spares = {{"rear", {nan}}};
            }),
            "sensor 'x': spares['rear']: radius is nan: must be above 0");
  EXPECT_EQ(fault([](Cfg& c) {
              c.marks = {"a", "c"};
            }),
            "sensor 'x': marks is 'c': must be one of a, b; did you mean 'a' or 'b'?");
  EXPECT_EQ(fault([](Cfg& c) { c.marks = {"a", "a"}; }), "sensor 'x': marks has 'a' twice");
  EXPECT_EQ(fault([](Cfg& c) { c.marks = {}; }), "sensor 'x': marks is empty; choose from a, b");
}

TEST(Fields, WordsIgnoreCaseAndErrorsNameTheNearest) {
  EXPECT_EQ(from_word<Side>("LEFT", "sensor 'x'", "side"), Side::kLeft);
  EXPECT_EQ(enum_name(Side::kRight), "right");
  try {
    from_word<Side>("rihgt", "sensor 'x'", "side");
    FAIL();
  } catch (const ValueError& e) {
    EXPECT_STREQ(e.what(),
                 "sensor 'x': side is 'rihgt': must be one of left, right; did you mean 'right'?");
  }
}

TEST(Fields, BasesAreListedAndPartsAreNot) {
  const StructDecl& decl = struct_of<Cfg>();
  ASSERT_EQ(decl.bases.size(), 1u);
  EXPECT_STREQ(decl.bases[0].name, "Base");
  EXPECT_STREQ(decl.find("name")->owner, "Base");
  EXPECT_STREQ(decl.find("side")->owner, "Cfg");
  Cfg cfg;
  cfg.name = "y";
  EXPECT_EQ(*static_cast<std::string*>(at(&cfg, *decl.find("name"))), "y");
}

}  // namespace fields_test
}  // namespace mjsense
