// SPDX-License-Identifier: Apache-2.0
// Benchmark of ThreadPool: runs of 16 items in quick succession, after a pause. Only the runs are
// timed. Name: pool/<us of work>/<us of pause>/<threads>.

#include <benchmark/benchmark.h>

#include <chrono>

#include "mjsense/core/system/thread_pool.h"

namespace mjsense {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kItems = 16;

void compute(long loops) {
  unsigned x = 1;
  for (long i = 0; i < loops; ++i) benchmark::DoNotOptimize(x = x * 1664525u + 1013904223u);
}

// Loop iterations of compute() per microsecond on this machine.
double loops_a_microsecond() {
  double best = 0;
  for (int k = 0; k < 20; ++k) {
    constexpr long kLoops = 1'000'000;
    const auto start = Clock::now();
    compute(kLoops);
    const double us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    if (kLoops / us > best) best = kLoops / us;
  }
  return best;
}

void pool(benchmark::State& state) {
  static const double loops = loops_a_microsecond();
  const auto work = static_cast<long>(static_cast<double>(state.range(0)) * loops / kItems);
  const std::chrono::microseconds pause(state.range(1));
  ThreadPool threads(static_cast<int>(state.range(2)));
  for (auto _ : state) {
    for (const auto end = Clock::now() + pause; Clock::now() < end;) {
    }
    const auto start = Clock::now();
    threads.run(kItems, [&](int, int) { compute(work); });
    state.SetIterationTime(std::chrono::duration<double>(Clock::now() - start).count());
  }
}
BENCHMARK(pool)->ArgsProduct({{50, 100, 400}, {10, 1000}, {1, 2}})->UseManualTime();

}  // namespace
}  // namespace mjsense
