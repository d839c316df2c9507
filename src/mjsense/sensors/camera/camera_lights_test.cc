// SPDX-License-Identifier: Apache-2.0
// Which lights are active, if there are more than MuJoCo's OpenGL renderer supports.

#include <gtest/gtest.h>

#include <string>

#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

CameraSensorCfg one_pixel(int max_lights) {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "c";
  cfg.width = cfg.height = 1;
  cfg.max_lights = max_lights;
  return cfg;
}

// Red value of a white floor under twelve lights. Each light adds 5 % of full white, and so does
// the headlight.
int brightness(int max_lights, const std::string& head, const std::string& first = "") {
  std::string lights = first;
  for (int i = 0; i < 12; ++i)
    lights += "<light type='directional' diffuse='.05 .05 .05' specular='0 0 0' ambient='0 0 0'/>";
  const TestModel m(
      "<mujoco><visual><headlight ambient='0 0 0' specular='0 0 0' diffuse='.05 .05 .05' active='" +
      head + "'/></visual><worldbody>" + lights +
      "<geom type='plane' size='1 1 1' rgba='1 1 1 1'/><camera name='c' pos='0 0 "
      "1'/></worldbody></mujoco>");
  rays::RayScene rays(m.model, 1);
  rays.update(m.world());
  return testing::shoot(one_pixel(max_lights), m, rays)->field("rgb").data.row<std::uint8_t>(0)[0];
}

TEST(CameraLights, FirstEightAreActiveAsInMujoco) {
  const auto share = [](int lights) { return 255 * 0.05 * lights; };
  EXPECT_NEAR(brightness(8, "0"), share(8), 1);
  EXPECT_NEAR(brightness(8, "1"), share(8), 1);  // the headlight counts too
  EXPECT_NEAR(brightness(3, "1"), share(3), 1);
  EXPECT_NEAR(brightness(32, "1"), share(13), 1);
  // A light that is off does not count.
  EXPECT_NEAR(brightness(8, "0", "<light active='false'/>"), share(8), 1);
}

TEST(CameraLights, TwelveLightsLookAsWithOpenGL) {
  const char* colors[] = {"1 0 0",  "0 1 0",  "0 0 1", "1 1 0",   "1 0 1", "0 1 1",
                          "1 .5 0", "0 .5 1", "1 1 1", ".5 1 .5", "1 1 1", "1 .5 .5"};
  for (const char* shadows : {"false", "true"}) {
    for (const char* head : {"0", "1"}) {
      std::string lights;
      for (int i = 0; i < 12; ++i)
        lights += "<light pos='" + testing::vec({i % 4 - 1.5, i / 4 - 1.0, 1}) +
                  "' cutoff='35' castshadow='" + shadows + "' diffuse='" + colors[i] + "'/>";
      const TestModel m(
          std::string("<mujoco><visual><headlight active='") + head +
          "'/><quality numquads='50' shadowsize='512'/></visual><worldbody>" + lights +
          "<geom type='plane' size='3 3 .05'/><geom type='box' size='.1 .2 .1' pos='0 0 .1'/>"
          "<camera name='c' pos='0 0 5'/></worldbody></mujoco>");
      CameraSensorCfg cfg = one_pixel(8);
      cfg.width = 96;
      cfg.height = 72;
      cfg.use_shadows = true;
      const testing::Pair pair(cfg, m);
      if (!pair.opengl) GTEST_SKIP() << pair.missing;
      EXPECT_GT(pair.psnr(), 29) << "shadows " << shadows << ", headlight " << head;
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
