// SPDX-License-Identifier: Apache-2.0
#pragma once
// CRC-32 (IEEE 802.3), as zlib and Python's zlib.crc32 compute it, where the CPU can multiply
// polynomials three to ten times as fast as zlib.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace mjsense {

// Of bytes that follow others whose CRC-32 is `crc`; 0 where there are none.
[[nodiscard]] std::uint32_t crc32_of(std::uint32_t crc, const void* bytes, std::size_t count);

namespace detail {
// What crc32_of() chooses from. Those that multiply are the ones that this CPU and MJSENSE_ISA
// allow, the fastest last.
using Crc32 = std::uint32_t (*)(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count);
std::uint32_t crc32_portable(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count);
std::vector<Crc32> crc32_multiplying();
}  // namespace detail

}  // namespace mjsense
