// SPDX-License-Identifier: Apache-2.0
#pragma once
// What this process is and has: whether it was forked, how much address space it may still take.

#include <cstdint>
#include <string>

namespace mjsense {

inline constexpr int kMostThreads = 4096;  // more is a slip of the finger

// Owners of threads. In the child of a fork their threads do not exist, and waiting for them would
// never end: there every owner that was made before is an orphan.
void add_owner(const void* owner);
[[nodiscard]] bool is_orphan(const void* owner);
// At its end; true if it is an orphan.
[[nodiscard]] bool forget_owner(const void* owner);

// Bytes of address space left below RLIMIT_AS; the largest number if there is none.
[[nodiscard]] std::uint64_t available_address_space();

[[nodiscard]] std::string gigabytes(std::uint64_t bytes);  // "1.5 GB"

}  // namespace mjsense
