// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/process_state.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sys/resource.h>

#include <limits>
#include <mutex>
#include <set>

#include "mjsense/core/system/os.h"

namespace mjsense {
namespace {

constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

struct Owners {
  std::mutex mutex;
  std::set<const void*> alive, orphans;
};

// Never destroyed, because owners may be destroyed after static objects.
Owners& owners() {
  static Owners& all = *[] {
    pthread_atfork([] { owners().mutex.lock(); }, [] { owners().mutex.unlock(); },
                   [] {
                     owners().orphans.merge(owners().alive);
                     owners().mutex.unlock();
                   });
    return new Owners;
  }();
  return all;
}

}  // namespace

void add_owner(const void* owner) {
  const std::lock_guard lock(owners().mutex);
  owners().alive.insert(owner);
}

bool is_orphan(const void* owner) {
  const std::lock_guard lock(owners().mutex);
  return owners().orphans.contains(owner);
}

bool forget_owner(const void* owner) {
  const std::lock_guard lock(owners().mutex);
  owners().alive.erase(owner);
  return owners().orphans.erase(owner) > 0;
}

std::uint64_t available_address_space() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  const std::uint64_t taken = os::address_space();
  return limit.rlim_cur > taken ? limit.rlim_cur - taken : 0;
}

std::string gigabytes(std::uint64_t bytes) {
  return fmt::format("{:.3g} GB", static_cast<double>(bytes) / 1e9);
}

}  // namespace mjsense
