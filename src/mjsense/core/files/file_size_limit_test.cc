// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/file_size_limit.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense {
namespace {

// Runs `write` in the child process of a death test, with a file size limit of 1000 bytes.
void write_with_a_limit(const testing::TempDir& folder, auto&& write) {
  const rlimit limit{1000, 1000};
  setrlimit(RLIMIT_FSIZE, &limit);
  write(folder.path / "large");
}

TEST(FileLimit, WriteBeyondTheLimitFails) {
  const testing::TempDir folder;
  EXPECT_EXIT(write_with_a_limit(folder,
                                 [](const std::filesystem::path& path) {
                                   const std::vector<std::byte> bytes(5000);
                                   try {
                                     write_file(path, {bytes});
                                   } catch (const std::exception& e) {
                                     fprintf(stderr, "%s\n", e.what());
                                     std::_Exit(7);
                                   }
                                 }),
              ::testing::ExitedWithCode(7), "large': File too large");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path));
}

// The guard removes only its own signal. Writes outside of it raise SIGXFSZ as before.
TEST(FileLimit, SignalIsUnchangedOutsideTheGuard) {
  const testing::TempDir folder;
  const auto write_much = [](const std::filesystem::path& path) {
    const Fd file(creat(path.c_str(), 0600));
    const std::string bytes(1000, 'x');
    for (int i = 0; i < 2; ++i) {
      const FileLimitGuard limit;
      const FileLimitGuard nested;
      errno = 0;
      const bool written = write(file.get(), bytes.data(), bytes.size()) == 1000;
      if (written != (i == 0) || (i == 1 && errno != EFBIG)) std::_Exit(1);
    }
    fprintf(stderr, "errors until here\n");
    static_cast<void>(!write(file.get(), bytes.data(), bytes.size()));
  };
  EXPECT_EXIT(write_with_a_limit(folder, write_much), ::testing::KilledBySignal(SIGXFSZ),
              "errors until here");
}

}  // namespace
}  // namespace mjsense
