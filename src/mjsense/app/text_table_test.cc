// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/text_table.h"

#include <gtest/gtest.h>

#include "mjsense/core/system/print_stderr.h"

namespace mjsense::app {
namespace {

TEST(Table, NamesDoNotControlTheTerminal) {
  const Table table{{"name", "unit"}, "ll", {{"a\x1b[31m", "m"}, {"b\nc", "s"}}};
  EXPECT_EQ(table.text(), "name    unit\na?[31m  m\nb?c     s\n");
}

TEST(Say, NamesDoNotControlTheTerminal) {
  ::testing::internal::CaptureStderr();
  print_stderr("mjsense: {}\nnext\n", "geom '\x1b[2Jx'");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "mjsense: geom '?[2Jx'\nnext\n");
}

}  // namespace
}  // namespace mjsense::app
