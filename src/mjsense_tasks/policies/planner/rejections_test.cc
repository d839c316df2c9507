// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/rejections.h"

#include <gtest/gtest.h>

#include "mjsense/observe/testing/world.h"

namespace mjsense::tasks::policies {
namespace {

TEST(Refusals, AreCountedByReasonAndNameTheBodiesThatCollideMost) {
  const observe::TestWorld w(R"(<mujoco><worldbody><geom name="wall" size=".1"/>
    <body name="shelf"><geom size=".1"/><body><geom size=".1"/></body></body>
    <body name="hand" pos="1 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  EXPECT_EQ(text_of("grasps", {}, w.model), "0 grasps");
  const std::vector<Rejection> rejections{{"out of reach"},
                                          Rejection::collision({3, 2}),
                                          {},
                                          Rejection::collision({3, 0}),
                                          Rejection::collision({3, 2}),
                                          {"out of reach"}};
  EXPECT_EQ(text_of("grasps", rejections, w.model),
            "5 grasps: 3 in collision, mostly 'hand' with 'shelf'; 2 out of reach");
}

}  // namespace
}  // namespace mjsense::tasks::policies
