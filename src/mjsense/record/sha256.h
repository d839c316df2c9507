// SPDX-License-Identifier: Apache-2.0
#pragma once
// SHA-256 (FIPS 180-4), for the names of model archives. Stored recordings have these names, and
// `mjsense verify` and `sha256sum` check an archive against them. XXH3, the key of equal textures and
// meshes, could be forged: another model with the name of the recorded one would pass.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace mjsense::record {

class Sha256 {
 public:
  void add(const void* bytes, std::size_t count);
  // The 64 hexadecimal digits of the sum of all bytes that were added.
  [[nodiscard]] std::string text() const;

 private:
  void add_block(const std::uint8_t* block);

  std::array<std::uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                         0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<std::uint8_t, 64> block_ = {};  // the first bytes_ % 64 of it are waiting
  std::uint64_t bytes_ = 0;
};

// model_{the first 12 digits of the sum}.zip
[[nodiscard]] std::string archive_name(const std::string& sha256);

}  // namespace mjsense::record
