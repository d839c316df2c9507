// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/outcome_details.h"

#include <gtest/gtest.h>

namespace mjsense::record {
namespace {

TEST(Outcome, DetailsOfPlannersAreLeftOut) {
  EXPECT_EQ(outcome_without_details("the policy gave up: found no plan (5 grasps: 5 out of reach)"),
            "the policy gave up: found no plan");
  EXPECT_EQ(outcome_without_details("the policy gave up: found no way (5 grasps: 5 out of reach)"),
            "the policy gave up: found no way");
}

TEST(Outcome, OtherParenthesesAreKept) {
  for (const char* text : {"success", "the policy gave up: found no plan",
                           "sensor 'x', world 0: ValueError: shape (2,) is not (1,)"})
    EXPECT_EQ(outcome_without_details(text), text);
}

}  // namespace
}  // namespace mjsense::record
