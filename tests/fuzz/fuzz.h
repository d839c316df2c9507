// SPDX-License-Identifier: Apache-2.0
#pragma once
// Functions shared by the fuzz targets. A target is a file x_fuzz.cc with one function; run.py runs
// the targets.

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

namespace mjsense::fuzz {

// Reports a violated property that sanitisers cannot detect, and aborts.
[[noreturn]] inline void broken(const char* promise, std::string_view found) {
  std::fprintf(stderr, "violated property: %s: %.*s\n", promise, static_cast<int>(found.size()),
               found.data());
  std::abort();
}

// Writes the bytes to a file in memory, which is created once and overwritten for each input.
class MemoryFile {
 public:
  MemoryFile() : fd_(memfd_create("input", MFD_CLOEXEC)) {}
  int fd() const { return fd_; }
  std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }
  void write(const std::uint8_t* data, std::size_t size) {
    if (ftruncate(fd_, 0) != 0 || pwrite(fd_, data, size, 0) != static_cast<ssize_t>(size))
      std::abort();
    lseek(fd_, 0, SEEK_SET);
  }

 private:
  int fd_;
};

}  // namespace mjsense::fuzz
