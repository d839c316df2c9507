// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/yuv.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "mjsense/core/system/cpu.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/record/process.h"

namespace mjsense::record {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes converted(const Bytes& rgb, int width, int height) {
  Bytes out(yuv420_bytes(width, height));
  encode_yuv420(rgb, width, height, out);
  return out;
}

Bytes plain(int width, int height, const Bytes& colour) {
  Bytes rgb;
  for (int i = 0; i < width * height; ++i) rgb.insert(rgb.end(), colour.begin(), colour.end());
  return rgb;
}

// A smooth ramp with edges and noise, so that every rounding case occurs.
Bytes picture(int width, int height, unsigned seed = 1) {
  Bytes rgb;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        seed = seed * 1664525u + 1013904223u;
        const bool edge = (x / 7 + y / 5 + c) % 3 == 0;
        rgb.push_back(static_cast<std::uint8_t>(
            edge ? seed >> 24 : (5 * x + 3 * y + 80 * c + (seed >> 30)) % 256));
      }
    }
  }
  return rgb;
}

TEST(Yuv, ColoursAreThoseOfBt601) {
  struct Case {
    Bytes rgb;
    int y, u, v;
  };
  for (const Case& c : {Case{{255, 255, 255}, 235, 128, 128}, Case{{0, 0, 0}, 16, 128, 128},
                        Case{{128, 128, 128}, 126, 128, 128}, Case{{255, 0, 0}, 81, 90, 240},
                        Case{{0, 255, 0}, 145, 54, 34}, Case{{0, 0, 255}, 41, 240, 110},
                        Case{{255, 255, 0}, 210, 16, 146}}) {
    for (const auto& [width, height] : {std::pair(16, 12), std::pair(2, 2), std::pair(5, 3)}) {
      const Bytes yuv = converted(plain(width, height, c.rgb), width, height);
      const std::size_t luma = yuv.size() / 3 * 2, quarter = luma / 4;
      for (std::size_t i = 0; i < yuv.size(); ++i) {
        const int wanted = i < luma ? c.y : i < luma + quarter ? c.u : c.v;
        ASSERT_NEAR(yuv[i], wanted, 1) << fmt::format("byte {} of {} x {}", i, width, height);
      }
    }
  }
}

TEST(Yuv, PlanesAreInOrder) {
  // The left half is red and the right half blue; the lower half is dark.
  const int width = 32, height = 24;
  Bytes rgb(3 * width * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rgb[3 * (y * width + x) + (x < width / 2 ? 0 : 2)] = y < height / 2 ? 255 : 50;
  const Bytes yuv = converted(rgb, width, height);
  const auto at = [&](int plane, int x, int y) {
    const int stride = plane == 0 ? width : width / 2;
    const int first = plane == 0   ? 0
                      : plane == 1 ? width * height
                                   : width * height + width * height / 4;
    return static_cast<int>(yuv[first + y * stride + x]);
  };
  EXPECT_NEAR(at(0, 0, 0), 81, 1);
  EXPECT_NEAR(at(0, width - 1, 0), 41, 1);
  EXPECT_NEAR(at(0, 0, height - 1), 16 + (81 - 16) * 50 / 255, 1);
  EXPECT_NEAR(at(1, 0, 0), 90, 1);
  EXPECT_NEAR(at(1, width / 2 - 1, 0), 240, 1);
  EXPECT_NEAR(at(2, 0, 0), 240, 1);
  EXPECT_NEAR(at(2, width / 2 - 1, 0), 110, 1);
  EXPECT_NEAR(at(2, 0, height / 2 - 1), 128 + (240 - 128) * 50 / 255, 1);
}

TEST(Yuv, OddSizesRepeatTheirLastColumnAndRow) {
  const int width = 17, height = 13;
  const Bytes rgb = picture(width, height);
  Bytes even;
  for (int y = 0; y < height + 1; ++y)
    for (int x = 0; x < width + 1; ++x)
      for (int c = 0; c < 3; ++c)
        even.push_back(rgb[3 * (std::min(y, height - 1) * width + std::min(x, width - 1)) + c]);
  EXPECT_EQ(yuv420_bytes(width, height), 18u * 14 * 3 / 2);
  EXPECT_EQ(converted(rgb, width, height), converted(even, width + 1, height + 1));
  EXPECT_EQ(converted({255, 0, 0}, 1, 1).size(), 6u);
}

TEST(Yuv, InstructionSetsAgree) {
  std::vector<Yuv420Kernel> kernels;
  if constexpr (kHasAvx) {
    if (cpu_isa() >= Isa::kAvx2) kernels.push_back(yuv420_avx2);
    if (cpu_isa() >= Isa::kAvx512) kernels.push_back(yuv420_avx512);
  }
  for (const auto& [width, height] : {std::pair(640, 48), std::pair(61, 9), std::pair(2, 4)}) {
    const Bytes rgb = picture(width, height);
    std::vector<std::int16_t> scratch(yuv420_scratch(width));
    Bytes plain(yuv420_bytes(width, height)), other(plain.size());
    yuv420_portable(rgb.data(), width, height, plain.data(), scratch.data());
    EXPECT_EQ(plain, converted(rgb, width, height));
    for (const Yuv420Kernel kernel : kernels) {
      kernel(rgb.data(), width, height, other.data(), scratch.data());
      EXPECT_EQ(plain, other) << width;
    }
  }
}

// Luma is equal bit for bit. Chroma differs by at most one step, and by 0 nearly everywhere: 2 % of
// the values are rounded differently by ffmpeg.
TEST(Yuv, EqualsFfmpeg) {
  const testing::TempDir dir;
  const int width = 320, height = 96;
  const Bytes rgb = picture(width, height);
  const std::filesystem::path raw = dir.path / "rgb", made = dir.path / "yuv";
  std::ofstream(raw, std::ios::binary)
      .write(reinterpret_cast<const char*>(rgb.data()), static_cast<std::streamsize>(rgb.size()));
  run_process({ffmpeg_program(""), "-nostdin", "-loglevel", "error", "-f", "rawvideo",
               "-pixel_format", "rgb24", "-video_size", fmt::format("{}x{}", width, height), "-i",
               raw.string(), "-pix_fmt", "yuv420p", "-f", "rawvideo", made.string()});
  std::ifstream in(made, std::ios::binary);
  const Bytes theirs((std::istreambuf_iterator<char>(in)), {});
  const Bytes ours = converted(rgb, width, height);
  ASSERT_EQ(ours.size(), theirs.size());
  const std::size_t luma = ours.size() / 3 * 2;
  EXPECT_TRUE(
      std::equal(ours.begin(), ours.begin() + static_cast<std::ptrdiff_t>(luma), theirs.begin()));
  std::size_t differ = 0;
  for (std::size_t i = luma; i < ours.size(); ++i) {
    ASSERT_NEAR(ours[i], theirs[i], 1) << i;
    differ += ours[i] != theirs[i];
  }
  EXPECT_LT(static_cast<double>(differ), 0.05 * static_cast<double>(ours.size() - luma));
}

}  // namespace
}  // namespace mjsense::record
