// SPDX-License-Identifier: Apache-2.0
#pragma once
// Linux-specific functions. They are confined to this file and os.cc, so that a port to another
// system replaces only os.cc.

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"

namespace mjsense::os {

int usable_cpus();  // for this process; 0: unknown

std::uint64_t free_memory();    // bytes, of the machine or its cgroup; maximum value: unknown
std::uint64_t address_space();  // bytes of address space used by this process; 0: unknown
// Seconds for which a process was ready to run but waited for a CPU; 0: unknown.
double waited_for_processor(int process);

// Open descriptors >= `first`. Used with kernels on which close_files() fails.
std::vector<int> open_files(int first);

// File descriptors that child programs do not inherit. If the result is empty, errno has the
// reason.
std::pair<Fd, Fd> make_pipe();         // read end, write end
Fd make_eventfd();                     // eventfd: readable after a write of 8 bytes
void widen_pipe(int pipe, int bytes);  // best effort
// Reserves disk space without changing the file's size; false: see errno.
bool reserve(int file, std::int64_t bytes);
// A path that leads to this open file or folder even after it is moved.
std::filesystem::path path_of(int file);

// Calls that are safe in a child between fork() and exec().
void die_with_parent();  // kills the child when its parent's thread ends
// false: not supported by this kernel (before 5.9)
bool close_files(unsigned first, unsigned last);

}  // namespace mjsense::os
