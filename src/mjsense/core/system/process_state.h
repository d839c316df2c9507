// SPDX-License-Identifier: Apache-2.0
#pragma once
// State of this process: whether it was forked, and how much address space it may still use.

#include <cstdint>
#include <string>

namespace mjsense {

inline constexpr int kMaxThreads = 4096;  // a larger number is taken for a typing error

// Registry of objects that own threads. In the child of a fork their threads do not exist, and
// joining them would block forever. In the child, every owner created before the fork is an orphan.
void add_owner(const void* owner);
[[nodiscard]] bool is_orphan(const void* owner);
// Called by an owner's destructor. Returns true if the owner is an orphan.
[[nodiscard]] bool forget_owner(const void* owner);

// Bytes of address space left below RLIMIT_AS; the maximum value if there is no limit.
[[nodiscard]] std::uint64_t available_address_space();

[[nodiscard]] std::string gigabytes(std::uint64_t bytes);  // "1.5 GB"

}  // namespace mjsense
