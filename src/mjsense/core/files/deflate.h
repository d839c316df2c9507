// SPDX-License-Identifier: Apache-2.0
#pragma once
// DEFLATE and CRC-32 by libdeflate. At level 4, chunks of joint positions are compressed 2.4 times
// as fast as by zlib (91 and 38 MB/s) to the same size, and CRC-32 is 3.4 times as fast (12 and 3.5
// GB/s; deflate_bench.cc, one Xeon core). Equal bytes give equal compressed bytes on every CPU with
// the same version of libdeflate.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace mjsense {

// RFC 1951 without a header, as in zip archives, or zlib's format (RFC 1950), as in HDF5 and PNG.
enum class DeflateFormat { kRaw, kZlib };

// The compressed bytes, which stay valid until this thread calls deflated() again. `level` is 1
// (fastest) to 9 (smallest).
std::span<const std::uint8_t> deflated(std::span<const std::uint8_t> bytes, int level,
                                       DeflateFormat format);

// Returns at most `maximum` bytes. Returns none if there would be more, or if `packed` is not a
// complete stream in zlib's format.
std::vector<std::uint8_t> inflated(std::span<const std::uint8_t> packed, std::size_t maximum);

// CRC-32 (IEEE 802.3) as computed by Python's zlib.crc32. Continues `crc`, the CRC-32 of the
// preceding bytes (0 if there are none), with `count` more bytes.
[[nodiscard]] std::uint32_t crc32_of(std::uint32_t crc, const void* bytes, std::size_t count);

}  // namespace mjsense
