// SPDX-License-Identifier: Apache-2.0
#pragma once
// Counts heap allocations of this process (all threads) made through operator new. For tests only:
// including this header replaces the global operator new (weakly, so that several files of a test
// program may).

#include <atomic>
#include <cstdlib>
#include <new>

namespace mjsense {

inline std::atomic<long> allocations_so_far{0};

class AllocationCount {
 public:
  AllocationCount() : start_(allocations_so_far) {}
  long since() const { return allocations_so_far - start_; }

 private:
  long start_;
};

}  // namespace mjsense

// Under the address sanitiser nothing is counted: it has its own operator new, which also detects
// errors.
#ifndef __SANITIZE_ADDRESS__

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // malloc and free are the pair here
[[gnu::weak]] void* operator new(std::size_t size) {
  ++mjsense::allocations_so_far;
  if (void* p = std::malloc(size ? size : 1)) return p;
  throw std::bad_alloc();
}
[[gnu::weak]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++mjsense::allocations_so_far;
  return std::malloc(size ? size : 1);
}
[[gnu::weak]] void* operator new(std::size_t size, std::align_val_t align) {
  ++mjsense::allocations_so_far;
  const auto a = static_cast<std::size_t>(align);
  if (void* p = std::aligned_alloc(a, (size + a - 1) / a * a)) return p;
  throw std::bad_alloc();
}
[[gnu::weak]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::weak]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
[[gnu::weak]] void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
[[gnu::weak]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}
#pragma GCC diagnostic pop

#endif
