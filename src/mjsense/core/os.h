// SPDX-License-Identifier: Apache-2.0
#pragma once
// What Linux has and POSIX has not: in this file and os.cc alone, so that another system is another
// os.cc.

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "mjsense/core/fd.h"

namespace mjsense::os {

int usable_cpus();  // by this process; 0: not known

std::uint64_t free_memory();  // bytes, of the machine or its cgroup; the largest number: not known
double waited_for_processor(int process);  // seconds in which it could have run; 0: not known
std::uint64_t address_space();             // bytes that this process has; 0: not known

// Descriptors from `first` on that are open; for kernels on which close_files() fails.
std::vector<int> open_files(int first);

// Files that no program we start inherits. An empty one: errno says why.
std::pair<Fd, Fd> make_pipe();  // to read from, to write to
Fd memory_file(const char* name);
Fd wake_up();                                // eventfd: readable after a write of 8 bytes
void widen_pipe(int pipe, int bytes);        // a wish
bool reserve(int file, std::int64_t bytes);  // disk space, without a change of size; false: errno
std::filesystem::path path_of(int file);  // that leads to this open file or folder, wherever it is

// Calls that a child may make between fork() and exec().
void end_with_parent();                           // it is killed when its parent's thread ends
bool close_files(unsigned first, unsigned last);  // false: not with this kernel (before 5.9)

}  // namespace mjsense::os
