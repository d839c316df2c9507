// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/png.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/files/deflate.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense {
namespace {

void put_u32(std::vector<std::uint8_t>& out, std::uint32_t x) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(x >> shift));
}

void put_chunk(std::vector<std::uint8_t>& out, const char (&type)[5],
               std::span<const std::uint8_t> body) {
  put_u32(out, static_cast<std::uint32_t>(body.size()));
  const std::size_t start = out.size();
  out.insert(out.end(), type, type + 4);
  out.insert(out.end(), body.begin(), body.end());
  put_u32(out, crc32_of(0, out.data() + start, out.size() - start));
}

}  // namespace

std::vector<std::uint8_t> encode_png(std::span<const std::uint8_t> pixels, int width, int height,
                                     int channels, int level, int bits) {
  const bool known = (channels == 1 || channels == 3 || channels == 4) && (bits == 8 || bits == 16);
  const std::size_t stride =
      static_cast<std::size_t>(std::max(width, 0)) * channels * bits / 8;  // bytes of a row
  if (width <= 0 || height <= 0 || !known || pixels.size() != stride * height) {
    throw ValueError(
        fmt::format("PNG: {} bytes do not match an image of {} x {} pixels with {} "
                    "channels (1, 3 or 4) of {} bits (8 or 16)",
                    pixels.size(), width, height, channels, bits));
  }

  // Filter 2: each row is stored as its difference from the row above, which compresses rendered
  // images well.
  std::vector<std::uint8_t> rows((stride + 1) * height);
  for (int y = 0; y < height; ++y) {
    std::uint8_t* to = rows.data() + y * (stride + 1);
    const std::uint8_t* from = pixels.data() + y * stride;
    *to++ = y == 0 ? 0 : 2;
    if (y == 0) {
      std::copy_n(from, stride, to);
      continue;
    }
    const std::uint8_t* above = from - stride;
    for (std::size_t i = 0; i < stride; ++i) to[i] = static_cast<std::uint8_t>(from[i] - above[i]);
  }

  std::vector<std::uint8_t> header;
  put_u32(header, width);
  put_u32(header, height);
  const std::uint8_t colour_type = channels == 1 ? 0 : channels == 3 ? 2 : 6;
  for (std::uint8_t b : {static_cast<std::uint8_t>(bits), colour_type, std::uint8_t{0},
                         std::uint8_t{0}, std::uint8_t{0}})
    header.push_back(b);

  std::vector<std::uint8_t> out = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  put_chunk(out, "IHDR", header);
  put_chunk(out, "IDAT", deflated(rows, level, DeflateFormat::kZlib));
  put_chunk(out, "IEND", {});
  return out;
}

void write_png(const std::filesystem::path& path, std::span<const std::uint8_t> pixels, int width,
               int height, int channels) {
  const std::vector<std::uint8_t> bytes = encode_png(pixels, width, height, channels);
  write_file(path, {std::as_bytes(std::span(bytes))});
}

}  // namespace mjsense
