// SPDX-License-Identifier: Apache-2.0
#pragma once
// A pool for casting rays and shading tiles. Ours, because a run allocates nothing, hands out items
// in order and names the lowest that failed; as fast as TBB's parallel_for (64 items on two
// threads: 0.3 against 1.2 us empty, 89 against 89 us of 1.4 us each). Physics runs on MuJoCo's own
// pool; the two never run at the same time, so together they never use more threads than asked for.

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace mjsense {

class ThreadPool {
 public:
  // `threads` includes the caller's; <= 0: one per CPU that this process may use.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int size() const { return static_cast<int>(workers_.size()) + 1; }

  // Runs body(item, thread) for item in [0, n), thread in [0, size()); returns when all are done.
  // Items are handed out in order. The exception of the lowest failing item is rethrown here; the
  // other items still run. Allocates nothing.
  template <class Body>
  void run(int n, Body&& body) {
    run_parts(n, 1, body);
  }
  // The same, but each thread begins with a part of the items that is its own in every run, and
  // then helps the others: what it reads and writes again is in its cache. A lidar of 5,760 rays on
  // two threads: 66 us instead of 118.
  template <class Body>
  void run_near(int n, Body&& body) {
    run_parts(n, size(), body);
  }

 private:
  template <class Body>
  void run_parts(int n, int parts, Body& body) {
    run_raw(
        n, parts,
        [](void* ctx, int item, int thread) {
          (*static_cast<std::remove_reference_t<Body>*>(ctx))(item, thread);
        },
        const_cast<void*>(static_cast<const void*>(&body)));
  }

  // Items [begin, end) from which whoever is free takes the next.
  struct alignas(64) Part {
    std::atomic<int> next{0};
    int end = 0;
  };
  using Fn = void (*)(void* ctx, int item, int thread);
  void run_raw(int n, int parts, Fn fn, void* ctx);
  void work(int thread);
  void worker(int thread);
  void await_workers();

  std::vector<std::thread> workers_;
  bool spins_ = false;  // there is a CPU for every thread
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  // Written under the mutex; read without it by those who look before they sleep.
  std::atomic<std::uint64_t> epoch_{0};
  std::atomic<int> active_{0};  // workers inside the present run
  bool open_ = false;           // a worker may still join it
  bool stop_ = false;
  Fn fn_ = nullptr;
  void* ctx_ = nullptr;
  std::vector<Part> parts_;  // [size()]
  int num_parts_ = 1;        // of the present run
  int failed_item_ = -1;
  std::exception_ptr failure_;
};

// CPUs that this process may run on (its affinity mask, not the machine's count).
int available_cpus();

}  // namespace mjsense
