// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/lidar/npy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense::sensors {
namespace {

constexpr long kMaxRows = 10'000'000;

// The file, and the place for messages.
struct Source {
  const std::string& path;
  std::string_view context;
};

[[noreturn]] void fail(const Source& source, std::string_view what) {
  throw RuntimeError(fmt::format("{}: scan table '{}': {}", source.context, source.path, what));
}

// The text after 'key': in the header's Python dict, up to the next comma at the same level.
std::string_view entry(std::string_view header, std::string_view key, const Source& source) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  if (at == std::string_view::npos) fail(source, fmt::format("its header has no '{}'", key));
  std::string_view rest = header.substr(at + key.size() + 3);
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  return rest.substr(0, rest.starts_with('(') ? rest.find(')') + 1 : rest.find(','));
}

}  // namespace

std::vector<std::array<double, 2>> read_npy_pairs(const std::string& path,
                                                  std::string_view context) {
  const Source source{path, context};
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  // Opening a pipe would block until there is a writer.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail(source, "is not a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(source, "cannot be opened");
  char magic[8];
  if (!in.read(magic, 8) || std::memcmp(magic, "\x93NUMPY", 6) != 0)
    fail(source, "is not a .npy file");
  std::uint8_t size[4] = {};
  const int size_bytes = magic[6] == 1 ? 2 : 4;
  if (!in.read(reinterpret_cast<char*>(size), size_bytes))
    fail(source, "is truncated inside its header");
  const std::uint32_t header_size =
      size[0] | size[1] << 8 | size[2] << 16 | static_cast<std::uint32_t>(size[3]) << 24;
  if (header_size > (1u << 20)) fail(source, "has a header of more than 1 MiB");
  std::string header(header_size, '\0');
  if (!in.read(header.data(), header_size)) fail(source, "is truncated inside its header");

  const std::string_view type = entry(header, "descr", source),
                         order = entry(header, "fortran_order", source),
                         shape = entry(header, "shape", source);
  const bool single = type == "'<f4'";
  long rows = -1, columns = -1;
  if (std::sscanf(std::string(shape).c_str(), "(%ld, %ld)", &rows, &columns) != 2 || columns != 2 ||
      rows < 1 || (!single && type != "'<f8'") || order != "False")
    fail(source, fmt::format("contains {:.40} of shape {:.40}, fortran_order {:.40}: expected "
                             "'<f4' or '<f8' of shape (M, 2) in C order",
                             printable(type), printable(shape), printable(order)));
  // Memory is allocated for the bytes in the file, not for those that the header claims.
  const std::streamoff begin = in.tellg();
  const std::streamoff end = in.seekg(0, std::ios::end).tellg();
  const std::size_t row_bytes = single ? 8 : 16;
  if (begin < 0 || end < begin ||
      static_cast<std::size_t>(end - begin) / row_bytes < static_cast<std::size_t>(rows))
    fail(source, fmt::format("is truncated: expected {} rows", rows));
  if (rows > kMaxRows) fail(source, fmt::format("has more than {} rows", kMaxRows));
  std::vector<char> raw(static_cast<std::size_t>(rows) * row_bytes);
  if (!in.seekg(begin).read(raw.data(), static_cast<std::streamsize>(raw.size())))
    fail(source, fmt::format("cannot be read: expected {} rows", rows));
  std::vector<std::array<double, 2>> pairs(rows);
  for (long i = 0; i < 2 * rows; ++i) {
    float f;
    double d;
    if (single) {
      std::memcpy(&f, &raw[4 * i], 4);
      d = f;
    } else {
      std::memcpy(&d, &raw[8 * i], 8);
    }
    pairs[i / 2][i % 2] = d;
  }
  return pairs;
}

}  // namespace mjsense::sensors
