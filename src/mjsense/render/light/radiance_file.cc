// SPDX-License-Identifier: Apache-2.0
// Pictures of G. Ward's Radiance: a header of lines, an empty line, the resolution, and scanlines of
// RGBE pixels (three mantissas of 8 bits and a common exponent), which are run-length encoded by
// channel.

#include <fmt/format.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <string_view>

#include "mjsense/core/error.h"
#include "mjsense/render/light/environment_image.h"

namespace mjsense::render {
namespace {

ExrReader exr_reader = nullptr;

constexpr int kMaxHeight = 4096;
constexpr float kMaxRadiance = 1e9f;
constexpr std::size_t kMaxBytes = std::size_t{512} << 20;

class Reader {
 public:
  Reader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  [[noreturn]] void fail(const std::string& why) const {
    throw ValueError(fmt::format("environment '{}': {}", path_, why));
  }
  std::string_view line() {
    const std::size_t end = bytes_.find('\n', at_);
    if (end == std::string_view::npos || end - at_ > 4096) fail("its header is not complete");
    const std::string_view out = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return out;
  }
  std::uint8_t byte() {
    if (at_ == bytes_.size()) fail("the file ends before its last pixel");
    return static_cast<std::uint8_t>(bytes_[at_++]);
  }
  std::size_t rest() const { return bytes_.size() - at_; }
  // Whether a run-length encoded scanline of this width follows.
  bool encoded(int width) const {
    if (width < 8 || width > 0x7fff || rest() < 4) return false;
    const auto* p = reinterpret_cast<const std::uint8_t*>(bytes_.data() + at_);
    return p[0] == 2 && p[1] == 2 && p[2] < 128;
  }

 private:
  const std::string& path_;
  std::string_view bytes_;
  std::size_t at_ = 0;
};

// A scanline as [4, width] bytes.
void read_channels(Reader& in, int width, std::vector<std::uint8_t>& out) {
  if (!in.encoded(width)) {
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 4; ++c) out[c * width + x] = in.byte();
    return;
  }
  in.byte();
  in.byte();
  const int high = in.byte(), stated = high << 8 | in.byte();
  if (stated != width)
    in.fail(fmt::format("a scanline has {} pixels instead of {}", stated, width));
  for (int c = 0; c < 4; ++c)
    for (int x = 0; x < width;) {
      const int code = in.byte(), count = code > 128 ? code - 128 : code;
      if (count == 0 || count > width - x) in.fail("a run of pixels leaves its scanline");
      std::uint8_t* to = out.data() + c * width + x;
      if (code > 128) {
        std::fill_n(to, count, in.byte());
      } else {
        for (int i = 0; i < count; ++i) to[i] = in.byte();
      }
      x += count;
    }
}

}  // namespace

void set_exr_reader(ExrReader reader) { exr_reader = reader; }

EnvironmentImage parse_environment(const std::string& path, const std::string& bytes) {
  if (!path.ends_with(".exr")) return parse_radiance(path, bytes);
  if (!exr_reader)
    throw ValueError(fmt::format(
        "environment '{}': only the Python package reads .exr files; convert it to .hdr", path));
  return parse_radiance(path, exr_reader(path, bytes));
}

std::string read_environment_file(const std::string& path) {
  struct stat state;
  if (stat(path.c_str(), &state) != 0)
    throw ValueError(fmt::format("environment '{}': no such file", path));
  if (!S_ISREG(state.st_mode))
    throw ValueError(fmt::format("environment '{}': not a regular file", path));
  if (static_cast<std::size_t>(state.st_size) > kMaxBytes)
    throw ValueError(fmt::format("environment '{}': {} bytes; at most {} are read", path,
                                 state.st_size, kMaxBytes));
  std::ifstream file(path, std::ios::binary);
  if (!file) throw ValueError(fmt::format("environment '{}': the file cannot be read", path));
  std::string bytes(static_cast<std::size_t>(state.st_size), '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

EnvironmentImage parse_radiance(const std::string& path, std::string_view bytes) {
  Reader in(path, bytes);
  if (const std::string_view magic = in.rest() ? in.line() : "";
      magic != "#?RADIANCE" && magic != "#?RGBE")
    in.fail("not a Radiance picture (.hdr): it does not start with '#?RADIANCE'");
  double exposure = 1;
  bool rgbe = false;
  for (std::string_view line = in.line(); !line.empty(); line = in.line()) {
    if (line == "FORMAT=32-bit_rle_rgbe") rgbe = true;
    if (line.starts_with("EXPOSURE=")) {
      const double factor = std::strtod(std::string(line.substr(9)).c_str(), nullptr);
      if (!(factor > 1e-9 && factor < 1e9)) in.fail("EXPOSURE is not a number from 1e-9 to 1e9");
      exposure *= factor;
    }
  }
  if (!rgbe) in.fail("its header has no line 'FORMAT=32-bit_rle_rgbe'; other formats are not read");
  const std::string size(in.line());
  int width = 0, height = 0, end = 0;
  if (std::sscanf(size.c_str(), "-Y %9d +X %9d%n", &height, &width, &end) != 2 ||
      end != static_cast<int>(size.size()))
    in.fail("its resolution is not of the form '-Y HEIGHT +X WIDTH'");
  if (height < 1 || height > kMaxHeight || width != 2 * height)
    in.fail(
        fmt::format("{} x {} pixels; an equirectangular image is twice as wide as high, and at "
                    "most {} x {} pixels are read",
                    width, height, 2 * kMaxHeight, kMaxHeight));
  // An encoded scanline has at least two bytes for 127 pixels of each channel.
  if (in.rest() < static_cast<std::size_t>(height) * (width / 127 * 8 + 4))
    in.fail("the file ends before its last pixel");
  EnvironmentImage image{width, height, {}};
  image.rgb.resize(3 * static_cast<std::size_t>(width) * height);
  std::vector<std::uint8_t> row(4 * static_cast<std::size_t>(width));
  float* to = image.rgb.data();
  for (int y = 0; y < height; ++y) {
    read_channels(in, width, row);
    for (int x = 0; x < width; ++x) {
      const int exponent = row[3 * width + x];
      const double scale = exponent ? std::ldexp(1.0, exponent - 136) / exposure : 0;
      for (int c = 0; c < 3; ++c, ++to) {
        *to = static_cast<float>(row[c * width + x] * scale);
        if (!(*to <= kMaxRadiance))
          in.fail(fmt::format("radiance {:g} in column {}, row {}; the maximum is {:g}", *to, x, y,
                              kMaxRadiance));
      }
    }
  }
  return image;
}

}  // namespace mjsense::render
