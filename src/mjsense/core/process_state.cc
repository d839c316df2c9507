// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/process_state.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <mutex>
#include <set>

namespace mjsense {
namespace {

constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

struct Owners {
  std::mutex mutex;
  std::set<const void*> alive, orphans;
};

// Never destroyed: owners may end after it would be.
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

std::uint64_t number_in(const char* path) {
  std::ifstream file(path);
  std::uint64_t value = 0;
  return file >> value ? value : kUnlimited;  // "max" is no number
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

std::uint64_t available_memory() {
  std::uint64_t available = kUnlimited;
  std::ifstream file("/proc/meminfo");
  for (std::string word; file >> word;) {
    std::uint64_t kilobytes = 0;
    if (word == "MemAvailable:" && file >> kilobytes) available = kilobytes * 1024;
  }
  const std::uint64_t most = number_in("/sys/fs/cgroup/memory.max");
  const std::uint64_t taken = number_in("/sys/fs/cgroup/memory.current");
  if (most != kUnlimited && taken != kUnlimited)
    available = std::min(available, most > taken ? most - taken : 0);
  return available;
}

std::uint64_t available_address_space() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  std::ifstream file("/proc/self/statm");
  std::uint64_t pages = 0;
  file >> pages;
  const std::uint64_t taken = pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  return limit.rlim_cur > taken ? limit.rlim_cur - taken : 0;
}

std::string gigabytes(std::uint64_t bytes) {
  return fmt::format("{:.3g} GB", static_cast<double>(bytes) / 1e9);
}

}  // namespace mjsense
