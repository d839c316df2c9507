// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/close_inherited.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>

// Since glibc 2.34; null before.
extern "C" __attribute__((weak)) int posix_spawn_file_actions_addclosefrom_np(
    posix_spawn_file_actions_t* actions, int from) noexcept;

namespace mjsense {

void close_inherited(posix_spawn_file_actions_t* actions) {
  constexpr int kFirst = 3;
  if (posix_spawn_file_actions_addclosefrom_np) {
    posix_spawn_file_actions_addclosefrom_np(actions, kFirst);
    return;
  }
  // The files of this moment; one that is gone when the child closes it does no harm.
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
    const int fd = std::atoi(entry.path().filename().c_str());
    if (fd >= kFirst) posix_spawn_file_actions_addclose(actions, fd);
  }
}

}  // namespace mjsense
