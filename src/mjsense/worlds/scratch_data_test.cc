// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/scratch_data.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>

#include "mjsense/core/system/thread_pool.h"
#include "mjsense/core/testing/test_model.h"

namespace mjsense::worlds {
namespace {

ModelPtr slide() {
  return compile_mjcf(
      "<mujoco><worldbody><body><joint type='slide'/><geom "
      "size='.1'/></body></worldbody></mujoco>");
}

TEST(ScratchData, LendsToOneCallerAtATimeAndReuses) {
  const auto model = slide();
  ScratchData scratch(model.get());
  std::set<mjData*> seen;
  {
    const auto a = scratch.borrow(), b = scratch.borrow();
    EXPECT_NE(a.get(), b.get());
    a->qpos[0] = b->qpos[0] = 7;
    seen = {a.get(), b.get()};
  }
  const auto a = scratch.borrow(), b = scratch.borrow(), c = scratch.borrow();
  EXPECT_EQ(seen, (std::set{a.get(), b.get()}));
  EXPECT_EQ(a->qpos[0], 7) << "as it was left";
  EXPECT_FALSE(seen.contains(c.get()));
  EXPECT_EQ(c->qpos[0], 0);
}

TEST(ScratchData, ThreadsNeverShareData) {
  const auto model = slide();
  ScratchData scratch(model.get());
  ThreadPool pool(4);
  std::atomic<int> clashes = 0;
  pool.run(2000, [&](int task, int) {
    const auto mine = scratch.borrow();
    mine->qpos[0] = task;
    for (int i = 0; i < 50; ++i) mj_kinematics(model.get(), mine.get());
    clashes += mine->qpos[0] != task ? 1 : 0;
  });
  EXPECT_EQ(clashes, 0);
}

}  // namespace
}  // namespace mjsense::worlds
