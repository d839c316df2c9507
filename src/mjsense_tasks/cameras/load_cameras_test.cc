// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/load_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense::tasks::cameras {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kCamera[] =
    "[[cameras]]\nname = 'eye'\nmount = 'fixed'\npos = [1, 0, 1]\nfovy = 50\n";

// Every embedded file of every robot is valid.
TEST(LoadCameras, EveryEmbeddedSystemIsReadable) {
  int count = 0;
  for (const std::string& robot : DataFolder{"robot", "robots/", "/robot.toml"}.names()) {
    const std::string file = "embedded:robots/" + robot + "/robot.toml";
    for (const std::string& name : camera_system_names(file)) {
      const CameraSystemCfg system = load_camera_system(name, file);
      EXPECT_EQ(system.name, name);
      EXPECT_FALSE(system.cameras.empty()) << robot << " " << name;
      EXPECT_EQ(load_camera_system(robot + "/" + name, "elsewhere/robot.toml").width, system.width);
      ++count;
    }
  }
  EXPECT_GE(count, 12);
}

TEST(LoadCameras, LoadsSystemsOfARobotOnDisk) {
  const testing::TempDir dir;
  std::filesystem::create_directory(dir.path / "cameras");
  std::ofstream(dir.path / "cameras" / "corner.toml") << kCamera;
  std::ofstream(dir.path / "mine.toml") << "width = 32\n" << kCamera;
  const std::string robot = dir.file("robot.toml");
  EXPECT_THAT(camera_system_names(robot), ElementsAre("corner"));
  EXPECT_EQ(load_camera_system("corner", robot).cameras.at(0).name, "eye");
  EXPECT_EQ(load_camera_system(dir.file("mine.toml"), robot).width, 32);
  EXPECT_THAT(error_of([&] { (void)load_camera_system("corn", robot); }),
              HasSubstr("did you mean 'corner'?"));
  EXPECT_THAT(error_of([&] { (void)load_camera_system(dir.file("no.toml"), robot); }),
              HasSubstr("no such file"));
  std::ofstream(dir.path / "wrong.toml") << "[[cameras]]\nname = 'a'\nmonut = 'fixed'\n";
  EXPECT_THAT(error_of([&] { (void)load_camera_system(dir.file("wrong.toml"), robot); }),
              HasSubstr("'monut'; did you mean 'mount'"));
}

}  // namespace
}  // namespace mjsense::tasks::cameras
