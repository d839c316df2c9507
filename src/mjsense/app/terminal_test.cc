// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/terminal.h"

#include <gmock/gmock.h>

namespace mjsense::app {
namespace {

using testing::ElementsAre;

TEST(Terminal, TextIsBrokenAtSpaces) {
  EXPECT_THAT(wrap("one two three", 7), ElementsAre("one two", "three"));
  EXPECT_THAT(wrap("one two three", 100), ElementsAre("one two three"));
}

TEST(Terminal, LongWordGetsItsOwnLine) {
  EXPECT_THAT(wrap("a extraordinary b", 4), ElementsAre("a", "extraordinary", "b"));
}

TEST(Terminal, EmptyTextIsOneEmptyLine) { EXPECT_THAT(wrap("", 10), ElementsAre("")); }

TEST(Terminal, WidthCountsCharactersNotBytes) {
  EXPECT_EQ(display_width("└── a"), 5u);
  EXPECT_THAT(wrap("éé éé", 5), ElementsAre("éé éé"));
}

}  // namespace
}  // namespace mjsense::app
