// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <ctime>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace mjsense {
namespace {

using std::chrono::microseconds;

// Threads first spin and then sleep. The runs begin while they spin, when they stop spinning, and
// while they sleep.
TEST(ThreadPool, SuccessiveRunsWithAnyPause) {
  for (const int threads : {2, 5}) {
    ThreadPool pool(threads);
    std::vector<int> sums(16);  // no atomics: what items wrote is visible when run() returns
    int wanted = 0;
    for (int run = 0; run < 600; ++run) {
      pool.run(16, [&](int i, int) { sums[i] += run; });
      wanted += run;
      for (const int sum : sums) ASSERT_EQ(sum, wanted) << "run " << run;
      if (run % 3 == 1) std::this_thread::sleep_for(microseconds(run % 90));
    }
  }
}

TEST(ThreadPool, WorksAfterAnException) {
  ThreadPool pool(3);
  for (int run = 0; run < 200; ++run) {
    std::string what;
    try {
      pool.run(8, [](int i, int) {
        if (i >= 5) throw std::runtime_error(std::to_string(i));
      });
    } catch (const std::runtime_error& e) {
      what = e.what();
    }
    ASSERT_EQ(what, "5");
  }
}

// All threads run at once, one item each. No thread takes another's item while its own is pending.
TEST(ThreadPool, RunNearStartsItemsOnTheSameThreads) {
  ThreadPool pool(4);
  for (int run = 0; run < 100; ++run) {
    std::atomic<int> here{0};
    int by[4] = {};
    pool.run_near(4, [&](int i, int thread) {
      by[i] = thread;
      ++here;
      while (here < 4) std::this_thread::yield();
    });
    for (int i = 0; i < 4; ++i) ASSERT_EQ(by[i], i);
    if (run % 10 == 0) std::this_thread::sleep_for(microseconds(200));
  }
}

TEST(ThreadPool, RunNearRunsEveryItemOnce) {
  for (const int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    for (const int n : {1, 3, 37, 200}) {
      std::vector<int> hits(n);  // each item is run by one thread only
      pool.run_near(n, [&](int i, int) { ++hits[i]; });
      EXPECT_EQ(hits, std::vector<int>(n, 1));
    }
    try {
      pool.run_near(9, [](int i, int) {
        if (i % 4 == 3) throw std::runtime_error(std::to_string(i));
      });
      ADD_FAILURE();
    } catch (const std::runtime_error& e) {
      EXPECT_STREQ(e.what(), "3");
    }
  }
}

TEST(ThreadPool, DestructionWhileThreadsSpinOrSleep) {
  for (int pools = 0; pools < 60; ++pools) {
    ThreadPool pool(3);
    if (pools % 4) pool.run(pools, [](int, int) {});
    std::this_thread::sleep_for(microseconds(pools % 5 * 20));
  }
}

TEST(ThreadPool, IdlePoolUsesNoCpuTime) {
  ThreadPool pool(2);
  pool.run(64, [](int, int) {});
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const std::clock_t before = std::clock();  // of the whole process
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_LT(static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC, 0.02);
}

}  // namespace
}  // namespace mjsense
