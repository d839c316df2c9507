// SPDX-License-Identifier: Apache-2.0
// Benchmarks of ThreadPool.
// pool/<us of work>/<us of pause>/<threads>: runs of 16 items in quick succession, after a pause.
// Only the runs are timed.
// run, run_near, tbb_static and tbb_auto/<items>/<us of each>: two threads, compared with oneTBB.

#include <benchmark/benchmark.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

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

// compute() for so many microseconds.
long loops_of(double us) {
  static const double loops = loops_a_microsecond();
  return static_cast<long>(us * loops);
}

void pool(benchmark::State& state) {
  const long work = loops_of(static_cast<double>(state.range(0)) / kItems);
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

void time_items(benchmark::State& state, const auto& for_each) {
  const long work = loops_of(static_cast<double>(state.range(1)));
  for (auto _ : state)
    for_each(static_cast<int>(state.range(0)), [&](int, int = 0) { compute(work); });
}
void run(benchmark::State& state) {
  ThreadPool pool(2);
  time_items(state, [&](int n, const auto& body) { pool.run(n, body); });
}
void run_near(benchmark::State& state) {
  ThreadPool pool(2);
  time_items(state, [&](int n, const auto& body) { pool.run_near(n, body); });
}
void time_tbb(benchmark::State& state, const auto& partitioner) {
  tbb::task_arena arena(2);
  time_items(state, [&](int n, const auto& body) {
    arena.execute([&] { tbb::parallel_for(0, n, body, partitioner); });
  });
}
void tbb_static(benchmark::State& state) { time_tbb(state, tbb::static_partitioner()); }
void tbb_auto(benchmark::State& state) { time_tbb(state, tbb::auto_partitioner()); }

void sizes(benchmark::internal::Benchmark* b) {
  b->Args({64, 20})->Args({4096, 2})->Args({64, 0})->UseRealTime();
}
BENCHMARK(run)->Apply(sizes);
BENCHMARK(run_near)->Apply(sizes);
BENCHMARK(tbb_static)->Apply(sizes);
BENCHMARK(tbb_auto)->Apply(sizes);

}  // namespace
}  // namespace mjsense
