// SPDX-License-Identifier: Apache-2.0
// Environments: their preparation against formulas, and files that are not what they should be.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/render/light/environment_source.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

EnvironmentImage read(const std::string& path) {
  return parse_environment(path, read_environment_file(path));
}

template <class Radiance>
EnvironmentImage image_of(int height, Radiance radiance) {
  EnvironmentImage image{2 * height, height, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < 2 * height; ++x)
      for (int c = 0; c < 3; ++c)
        image.rgb.push_back(static_cast<float>(radiance(image.direction(x + 0.5, y + 0.5), c)));
  return image;
}

double matte(const EnvironmentLight& light, const Vec3& n, int c) {
  const auto [x, y, z] = n;
  const double b[9] = {1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y};
  double sum = 0;
  for (int i = 0; i < 9; ++i) sum += light.irradiance[i][c] * b[i];
  return sum;
}

std::array<float, 3> texel(const EnvironmentLight& light, int level, int face, int x, int y) {
  const int n = static_cast<int>(light.radiance.width[level]);
  return unpack_rgb9e5(
      light.radiance.texels[light.radiance.offset[level] + (face * n + y) * (n + 1) + x]);
}

TEST(Environment, UniformLightStaysUniform) {
  const auto made = prepared(image_of(128, [](const Vec3&, int) { return 7.0; }));
  for (int i = 0; i < 9; ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(made->light.irradiance[i][c], i ? 0 : 1, 1e-4);
  for (int level = 0; level < made->light.radiance.levels; ++level)
    for (int face = 0; face < 6; ++face)
      for (int at : {0, 3, 15})
        for (float x : texel(made->light, level, face, at, 15 - at)) EXPECT_NEAR(x, 1, 0.002);
}

// Radiance 1 + 0.5 z gives the irradiance pi (1 + z / 3); xy and 3 z^2 - 1 keep a quarter.
TEST(Environment, IrradianceEqualsItsIntegral) {
  const auto made = prepared(image_of(256, [](const Vec3& d, int c) {
    return 1 + 0.5 * d[2] + (c == 0 ? 0.4 * d[0] * d[1] : 0.1 * (3 * d[2] * d[2] - 1));
  }));
  for (const Vec3& n : {Vec3{1, 0, 0}, Vec3{0, 0, -1}, Vec3{0.6, -0.8, 0}, Vec3{0, 0.6, 0.8}}) {
    EXPECT_NEAR(matte(made->light, n, 0), 1 + n[2] / 3 + 0.1 * n[0] * n[1], 1e-3);
    EXPECT_NEAR(matte(made->light, n, 1), 1 + n[2] / 3 + 0.025 * (3 * n[2] * n[2] - 1), 1e-3);
  }
}

TEST(Environment, ASmallBrightLightGivesNoNegativeIrradiance) {
  const auto made =
      prepared(image_of(64, [](const Vec3& d, int) { return d[2] > 0.995 ? 1.0 : 0.0; }));
  for (int i = 0; i <= 100; ++i) {
    const double angle = std::numbers::pi * i / 100;
    EXPECT_GE(matte(made->light, {std::sin(angle), 0, std::cos(angle)}, 1), -1e-4);
  }
}

TEST(Environment, FirstLevelIsTheRadianceAndOthersAreSmoother) {
  const auto radiance = [](const Vec3& d, int c) { return 1 + 0.5 * d[c]; };
  const auto made = prepared(image_of(256, radiance));
  const EnvironmentLight& light = made->light;
  const int last = static_cast<int>(light.radiance.width[0]) - 1;
  // Corner of +x and -x: s = t = -1.
  const double r = 1 / std::sqrt(3);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(texel(light, 0, 0, 0, 0)[c], 1 + 0.5 * r, 0.01);
    EXPECT_NEAR(texel(light, 0, 1, last, last)[c], radiance({-r, -r, r}, c), 0.01);
  }
  // Towards +x, level by level: the contrast falls.
  double before = 1.51;
  for (int level = 0; level < light.radiance.levels; ++level) {
    const int middle = static_cast<int>(light.radiance.width[level]) / 2;
    const double now = texel(light, level, 0, middle, middle)[0];
    EXPECT_LT(now, before + 0.004) << level;
    before = now;
  }
  EXPECT_LT(before, 1.4);
}

TEST(Environment, NeighbouringFacesHaveEqualEdges) {
  const auto made =
      prepared(image_of(64, [](const Vec3& d, int c) { return 1 + 0.5 * d[c] * d[(c + 1) % 3]; }));
  const EnvironmentLight& light = made->light;
  for (int level = 0; level < light.radiance.levels; ++level) {
    const int n = static_cast<int>(light.radiance.width[level]);
    for (int y = 0; y < n; ++y) {
      EXPECT_EQ(texel(light, level, 0, 0, y), texel(light, level, 4, n - 1, y));          // +x, +z
      EXPECT_EQ(texel(light, level, 2, n - 1, y), texel(light, level, 0, n - 1 - y, 0));  // +y, +x
    }
  }
}

TEST(Environment, EqualSurroundingsArePreparedOnce) {
  const std::string xml =
      R"(<asset><texture type="skybox" builtin="gradient" rgb1="1 1 1" rgb2="0 0 0" width="8"
          height="48"/></asset><worldbody><geom size="1"/></worldbody>)";
  const testing::TestRenderer one(xml), other(xml);
  const auto first = environment(one.model.get(), "skybox");
  EXPECT_EQ(first, environment(other.model.get(), "auto"));
}

TEST(Environment, SkyboxIsLinearAndStandsUpright) {
  const testing::TestRenderer s(
      R"(<asset><texture type="skybox" builtin="gradient" rgb1="1 1 1" rgb2="0 0 0" width="64"
          height="384"/></asset><worldbody><geom size="1"/></worldbody>)");
  const EnvironmentImage image = skybox_image(s.model.get(), 0);
  EXPECT_GT(image.at({0, 0, 1})[1], 0.9);
  EXPECT_LT(image.at({0, 0, -1})[1], 0.05);
  EXPECT_EQ(error_of([] {
              const testing::TestRenderer none("<worldbody><geom size='1'/></worldbody>");
              return environment(none.model.get(), "skybox");
            }),
            "environment 'skybox': the model has no skybox texture; use 'studio' or an .hdr file");
}

TEST(Environment, PackedColours) {
  for (const std::array<float, 3>& rgb : {std::array<float, 3>{1, 0.5f, 0.25f},
                                          {0, 0, 0},
                                          {3000, 2, 1},
                                          {1e-3f, 2e-3f, 3e-3f},
                                          {0.9999f, 0, 0}}) {
    const auto back = unpack_rgb9e5(pack_rgb9e5(rgb.data()));
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(back[c], rgb[c], 0.0021 * std::max({rgb[0], rgb[1], rgb[2]}));
  }
  const float huge[3] = {1e9f, 1, 0};
  EXPECT_EQ(unpack_rgb9e5(pack_rgb9e5(huge))[0], 65408);
}

TEST(Environment, EveryTruncatedFileIsAnError) {
  const testing::TempDir folder;
  const std::string path = folder.file("x.hdr");
  std::string whole = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
  for (int y = 0; y < 4; ++y)
    whole += std::string("\x02\x02\x00\x08", 4) + "\x88\x40\x88\x41\x88\x42\x88\x82";
  for (std::size_t n = 0; n <= whole.size(); ++n) {
    std::ofstream(path, std::ios::binary) << whole.substr(0, n);
    const std::string text = error_of<ValueError>([&] { return read(path); });
    EXPECT_EQ(text.empty(), n == whole.size()) << n << " bytes: " << text;
  }
}

constexpr char kHeader[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n";

std::string error_of_file(const std::string& bytes) {
  const testing::TempDir folder;
  const std::string path = folder.file("x.hdr");
  std::ofstream(path, std::ios::binary) << bytes;
  std::string text = error_of<ValueError>([&] { return environment(nullptr, path); });
  if (const auto at = text.find(path); at != std::string::npos)
    text.replace(at, path.size(), "x.hdr");
  return text;
}

TEST(Environment, ReadsRunLengthEncodedAndPlainScanlines) {
  const testing::TempDir folder;
  const std::string path = folder.file("x.hdr");
  // 8 x 4 pixels; each encoded scanline: red 64, green 1..8, blue 0, exponent 2^(130 - 136).
  std::string encoded("\x02\x02\x00\x08", 4);
  encoded += std::string("\x88\x40", 2) + "\x08\x01\x02\x03\x04\x05\x06\x07\x08" +
             std::string("\x88\x00", 2) + "\x88\x82";
  std::string plain;
  for (int i = 0; i < 8; ++i) plain += "\x80\x40\x20\x81";
  std::ofstream(path, std::ios::binary) << kHeader << "-Y 4 +X 8\n"
                                        << encoded << encoded << encoded << plain;
  const EnvironmentImage image = read(path);
  EXPECT_EQ(image.width, 8);
  EXPECT_EQ(image.rgb[0], 1);
  EXPECT_EQ(image.rgb[3 * 7 + 1], 8.0f / 64);
  EXPECT_EQ(image.rgb[2], 0);
  EXPECT_EQ(image.rgb[3 * 24], 1);
  EXPECT_EQ(image.rgb[3 * 24 + 2], 0.25f);
}

TEST(Environment, DamagedFilesAreOneClearError) {
  const std::string start(kHeader), e = "environment 'x.hdr': ";
  EXPECT_EQ(error_of_file(""),
            e + "not a Radiance picture (.hdr): it does not start with '#?RADIANCE'");
  EXPECT_EQ(error_of_file("\x89PNG\r\n"),
            e + "not a Radiance picture (.hdr): it does not start with '#?RADIANCE'");
  EXPECT_EQ(error_of_file("#?RADIANCE\n\n-Y 4 +X 8\n"),
            e + "its header has no line 'FORMAT=32-bit_rle_rgbe'; other formats are not read");
  EXPECT_EQ(error_of_file("#?RADIANCE\nFORMAT=32-bit_rle_rgbe"), e + "its header is not complete");
  EXPECT_EQ(error_of_file(start + "+Y 4 +X 8\n"),
            e + "its resolution is not of the form '-Y HEIGHT +X WIDTH'");
  EXPECT_EQ(error_of_file(start + "-Y 100000 +X 200000\n"),
            e + "200000 x 100000 pixels; an equirectangular image is twice as wide as high, and at "
                "most 8192 x 4096 pixels are read");
  EXPECT_EQ(error_of_file(start + "-Y 4096 +X 8192\nxx"),
            e + "the file ends before its last pixel");
  EXPECT_EQ(error_of_file(start + "-Y 4 +X 8\n" + std::string(40, '\x02')),
            e + "a scanline has 514 pixels instead of 8");
  EXPECT_EQ(error_of_file(start + "-Y 4 +X 8\n" + std::string("\x02\x02\x00\x08", 4) +
                          std::string(40, '\xff')),
            e + "a run of pixels leaves its scanline");
  EXPECT_EQ(error_of_file(start + "-Y 1 +X 2\n\xff\xff\xff\xff\xff\xff\xff\xff"),
            e + "radiance 1.69477e+38 in column 0, row 0; the maximum is 1e+09");
  EXPECT_EQ(error_of([] { return environment(nullptr, "sky.jpg"); }),
            "environment 'sky.jpg': only pictures of type .hdr and .exr are read");
  EXPECT_EQ(error_of<KeyError>([] { return environment(nullptr, "stdio"); }),
            "environment: no surroundings named 'stdio'; did you mean 'studio'?");
  EXPECT_EQ(error_of([] { return environment(nullptr, "none.hdr"); }),
            "environment 'none.hdr': no such file");
}

}  // namespace
}  // namespace mjsense::render
