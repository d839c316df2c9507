// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/os.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <system_error>

namespace mjsense::os {
namespace {

constexpr std::uint64_t kUnknown = std::numeric_limits<std::uint64_t>::max();

std::uint64_t number_in(const char* path) {
  std::ifstream file(path);
  std::uint64_t value = 0;
  return file >> value ? value : kUnknown;  // "max" is not a number
}

}  // namespace

int usable_cpus() {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 0;
}

std::uint64_t free_memory() {
  std::uint64_t available = kUnknown;
  std::ifstream file("/proc/meminfo");
  for (std::string word; file >> word;) {
    std::uint64_t kilobytes = 0;
    if (word == "MemAvailable:" && file >> kilobytes) available = kilobytes * 1024;
  }
  const std::uint64_t maximum = number_in("/sys/fs/cgroup/memory.max");
  const std::uint64_t taken = number_in("/sys/fs/cgroup/memory.current");
  if (maximum != kUnknown && taken != kUnknown)
    available = std::min(available, maximum > taken ? maximum - taken : 0);
  return available;
}

double waited_for_processor(int process) {
  const auto tasks = std::filesystem::path("/proc") / std::to_string(process) / "task";
  double seconds = 0;
  std::error_code ignored;  // it has ended
  for (std::filesystem::directory_iterator it(tasks, ignored), end; !ignored && it != end;
       it.increment(ignored)) {
    std::uint64_t ran_ns = 0, waited_ns = 0;
    if (std::ifstream(it->path() / "schedstat") >> ran_ns >> waited_ns)
      seconds += 1e-9 * static_cast<double>(waited_ns);
  }
  return seconds;
}

std::uint64_t address_space() {
  const std::uint64_t pages = number_in("/proc/self/statm");
  return pages == kUnknown ? 0 : pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::pair<Fd, Fd> make_pipe() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return {};
  return {Fd(ends[0]), Fd(ends[1])};
}

Fd make_eventfd() { return Fd(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)); }

void widen_pipe(int pipe, int bytes) { fcntl(pipe, F_SETPIPE_SZ, bytes); }

std::filesystem::path path_of(int file) {
  return std::filesystem::path("/proc/self/fd") / std::to_string(file);
}

bool reserve(int file, std::int64_t bytes) {
  return fallocate(file, FALLOC_FL_KEEP_SIZE, 0, bytes) == 0;
}

void die_with_parent() { prctl(PR_SET_PDEATHSIG, SIGKILL); }

bool close_files(unsigned first, unsigned last) {
  constexpr long kCloseRange = 436;  // as a number, because glibc has a name for it only since 2.34
  return first > last || syscall(kCloseRange, first, last, 0U) == 0;
}

std::vector<int> open_files(int first) {
  std::vector<int> open;
  std::error_code ignored;  // a descriptor that is closed meanwhile does no harm
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
    const int fd = std::atoi(entry.path().filename().c_str());
    if (fd >= first) open.push_back(fd);
  }
  return open;
}

}  // namespace mjsense::os
