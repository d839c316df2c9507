// SPDX-License-Identifier: Apache-2.0
// Path-traced images of scenes whose radiance is known.

#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/path/path_tracer.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::kDark;
using testing::kX;
using testing::kY;
using testing::TestRenderer;

PhysicalOptions surrounded_by(double radiance) {
  PhysicalOptions out;
  out.on = true;
  out.path_samples = 1;
  out.occlusion_reach = 0;
  out.environment = upright_environment([=](double) { return radiance; });
  return out;
}

struct Traced {
  int width;
  std::vector<float> radiance;  // [H, W, 3]
  double around;                // factor of the environment

  double at(int x, int y, int c = 0) const { return radiance[3 * (y * width + x) + c]; }
  double mean() const {
    double sum = 0;
    for (float x : radiance) sum += x;
    return sum / static_cast<double>(radiance.size());
  }
};

Traced trace(TestRenderer& s, int samples, std::array<double, 3> at, int size, double fovy,
             std::array<double, 3> x = kX, std::array<double, 3> y = kY) {
  s.update();
  s.options.shadows = true;
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  const View& view = s.view(builder, at, x, y, grid_from_fovy(size, size, fovy, false));
  PathTracer tracer(
      samples, std::make_shared<const EnvironmentSampler>(s.options.physical.environment->light));
  tracer.build(view);
  Traced out{size, std::vector<float>(3 * size * size), view.physical.radiance_scale[0]};
  ImageTargets targets;
  targets.hdr = out.radiance.data();
  tracer.render(0, (size + kTileSize - 1) / kTileSize, targets);
  for (float& x : out.radiance) x /= view.physical.white_radiance;
  return out;
}

// The sphere reflects all light, so that it has the radiance of the room: it is invisible.
TEST(PathTracer, WhiteSphereVanishesInWhiteRoom) {
  for (int metallic = 0; metallic <= 10; metallic += 5)
    for (int roughness = 0; roughness <= 10; roughness += 2) {
      TestRenderer s(std::string(kDark) + R"(<asset><material name="m" rgba="1 1 1 1" metallic=")" +
                     std::to_string(metallic / 10.0) + R"(" roughness=")" +
                     std::to_string(roughness / 10.0) +
                     R"("/></asset><worldbody><geom size="1" material="m"/></worldbody>)");
      s.options.physical = surrounded_by(1);
      const Traced seen = trace(s, 64, {0, 0, 4}, 16, 20);
      EXPECT_NEAR(seen.mean() / seen.around, 1, 0.01) << metallic << " " << roughness;
    }
}

TEST(PathTracer, MatteSphereHasLambertsCosine) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="1 .5 .2 1"/></asset><worldbody>
    <light type="directional" dir=".6 0 -.8" diffuse="1 1 1"/>
    <geom size="1" material="m"/></worldbody>)");
  s.options.physical = surrounded_by(0);
  for (double x : {-0.9, -0.5, 0.0, 0.4, 0.7, 0.95}) {
    const double cosine = std::max(0.0, -0.6 * x + 0.8 * std::sqrt(1 - x * x));
    const Traced seen = trace(s, 16, {x, 0, 3}, 1, 0.01);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(seen.at(0, 0, c),
                  kClassicLight * srgb_decode(std::array{1.0, 0.5, 0.2}[c]) * cosine, 1e-3)
          << x << " " << c;
  }
}

// 1000 cd at a height of h m: E = 1000 / h^2 lux, and a white matte floor has the radiance E / pi. A ball
// of any radius gives as much.
TEST(PathTracer, CandelaFollowInverseSquareLaw) {
  for (double h : {1.5, 3.0})
    for (const char* radius : {"0", "0.5"}) {
      TestRenderer s(std::string(kDark) +
                     R"(<asset><material name="m" specular="0" rgba="1 1 1 1"/></asset><worldbody>
      <light type="point" diffuse="1 1 1" intensity="1000" range="1000" pos="0 0 )" +
                     std::to_string(h) + R"(" bulbradius=")" + radius + R"("/>
      <geom type="plane" size="5 5 1" material="m"/></worldbody>)");
      s.options.physical = surrounded_by(0);
      const double radiance = 1000 / (h * h) / M_PI / maximum_radiance(kDefaultExposure);
      const Traced seen = trace(s, 256, {0, 0, 1}, 4, 0.01);
      EXPECT_NEAR(seen.mean() / radiance, 1, 0.01) << h << " " << radius;
    }
}

// A ball of light and a sphere that glows as much light a floor equally, matte or metallic.
TEST(PathTracer, BallOfLightIsAGlowingSphere) {
  const double glow = 1000 / (M_PI * 0.3 * 0.3) / kClassicRadiance;
  const std::string light =
      R"(<light type="point" diffuse="1 1 1" intensity="1000" range="1000" pos="0 0 1" bulbradius="0.3"/>)";
  const std::string sphere = R"(<geom size="0.3" pos="0 0 1" rgba="1 1 1 1" material="glow"/>)";
  for (const char* metallic : {"0", "1"}) {
    double means[2];
    for (int k = 0; k < 2; ++k) {
      TestRenderer s(
          std::string(kDark) + R"(<asset><material name="glow" rgba="1 1 1 1" emission=")" +
          std::to_string(glow) + R"("/><material name="m" rgba=".7 .7 .7 1" roughness=".3"
        metallic=")" +
          metallic + R"("/></asset><worldbody>)" + (k ? sphere : light) +
          R"(<geom type="plane" size="5 5 1" material="m"/></worldbody>)");
      s.options.physical = surrounded_by(0);
      means[k] = trace(s, 64, {0.5, -1.5, 1}, 16, 40, {1, 0, 0}, {0, 0.5547, 0.83205}).mean();
    }
    EXPECT_GT(means[0], 0.05) << metallic;
    EXPECT_NEAR(means[1] / means[0], 1, 0.03) << metallic;
  }
}

// In a closed room whose walls have the albedo a = 0.5 and the emission e, the radiance is
// e (1 + a + a^2 + ...) = e / (1 - a).
TEST(PathTracer, ClosedRoomIsLitByAllReflections) {
  TestRenderer s(std::string(kDark) + R"(<compiler angle="degree"/><asset>
    <material name="m" specular="0" rgba=".735357 .735357 .735357 1" emission=".5"/></asset><worldbody>
    <geom type="plane" size="1 1 1" pos="0 0 -1" material="m"/>
    <geom type="plane" size="1 1 1" pos="0 0 1" euler="180 0 0" material="m"/>
    <geom type="plane" size="1 1 1" pos="0 1 0" euler="90 0 0" material="m"/>
    <geom type="plane" size="1 1 1" pos="0 -1 0" euler="-90 0 0" material="m"/>
    <geom type="plane" size="1 1 1" pos="-1 0 0" euler="0 90 0" material="m"/>
    <geom type="plane" size="1 1 1" pos="1 0 0" euler="0 -90 0" material="m"/></worldbody>)");
  s.options.physical = surrounded_by(100);
  const Traced seen = trace(s, 64, {0.1, -0.2, 0.3}, 16, 90, {1, 0, 0}, {0, 0.8, 0.6});
  EXPECT_NEAR(seen.mean(), 0.5 * 0.5 / (1 - 0.5), 0.005);
}

// E = 2 pi times the integral of (1 + z) z from 0 to 1; and half of it under glass of alpha 0.5.
TEST(PathTracer, SurroundingsLightAMatteFloor) {
  for (const bool glass : {false, true}) {
    TestRenderer s(
        std::string(kDark) +
        R"(<asset><material name="m" specular="0" rgba="1 1 1 1"/></asset><worldbody>
      <geom type="plane" size="5 5 1" material="m"/>)" +
        (glass ? R"(<geom type="box" size="900 900 1" pos="0 0 2" rgba="0 0 0 .5"/>)" : "") +
        "</worldbody>");
    s.options.physical = surrounded_by(0);
    s.options.physical.environment = upright_environment([](double z) { return 1 + z; });
    const Traced seen = trace(s, 256, {0, 0, 0.9}, 4, 1);
    // The black glass reflects 4 % and more of the floor's light.
    const double share = glass ? 0.5 : 1, room = glass ? 0.06 : 0.01;
    EXPECT_NEAR(seen.mean() / seen.around, share * 5 / 3, room * 5 / 3);
  }
}

TEST(PathTracer, ErrorFallsAtLeastWithTheSquareRootOfTheSamples) {
  TestRenderer s(std::string(kDark) + R"(<asset><material name="m" rgba=".8 .6 .3 1" metallic=".5"
    roughness=".3"/></asset><worldbody><light pos="1 -1 2" dir="-1 1 -2" bulbradius=".3"/>
    <geom type="plane" size="5 5 1"/><geom size=".5" pos="0 0 .5" material="m"/></worldbody>)");
  s.options.physical = surrounded_by(1);
  const auto shot = [&](int samples) {
    return trace(s, samples, {0, -2, 1.5}, 16, 40, {1, 0, 0}, {0, 0.6, 0.8}).radiance;
  };
  const std::vector<float> reference = shot(1024);
  const auto error = [&](int samples) {
    const std::vector<float> seen = shot(samples);
    double sum = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) sum += std::pow(seen[i] - reference[i], 2);
    return std::sqrt(sum / static_cast<double>(seen.size()));
  };
  EXPECT_GT(error(4) / error(64), 3.6);
}

}  // namespace
}  // namespace mjsense::render
