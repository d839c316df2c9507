// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writes zip archives in memory. The same entries give the same bytes: entries have no time.

#include <cstdint>
#include <string>
#include <string_view>

namespace mjsense {

class ZipWriter {
 public:
  // Appends a file, compressed with deflate. Throws ValueError if the name is longer than 65,535
  // bytes, or the archive would be larger than 4 GiB.
  void add(std::string_view name, std::string_view bytes);
  // The complete archive. Nothing can be added afterwards.
  [[nodiscard]] std::string finish();

 private:
  void require_room(std::size_t bytes) const;

  std::string files_, directory_;
  std::uint16_t count_ = 0;
};

}  // namespace mjsense
