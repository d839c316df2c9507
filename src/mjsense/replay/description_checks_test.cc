// SPDX-License-Identifier: Apache-2.0
// What is wrong with the description of a recording, and the streams that it lists.

#include "mjsense/replay/description_checks.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace mjsense::replay {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> faults(const char* text) {
  return description_faults(nlohmann::json::parse(text));
}

TEST(DescriptionChecks, RightValues) {
  EXPECT_THAT(faults("{}"), IsEmpty());
  EXPECT_THAT(faults(R"({"fps":"500/33","gzip":4,"settings":{},"model_archive":"model_1.zip",
                         "video":{"crf":25,"preset":"veryfast","tune":"","keyint":20,"threads":1,
                                  "depth_unit":0.0002,"molmospaces_depth":false}})"),
              IsEmpty());
}

TEST(DescriptionChecks, WrongValuesAreNamed) {
  for (const char* rate : {R"("1e999999999")", R"("1/0")", R"("0")", R"("-15")", R"("nan")",
                           R"("15/")", R"("1111111111111")", "15", "null"}) {
    EXPECT_THAT(faults(fmt::format(R"({{"fps":{}}})", rate).c_str()),
                ElementsAre(HasSubstr("whose fps is")))
        << rate;
  }
  EXPECT_THAT(faults(R"({"gzip":10})"), ElementsAre("whose gzip is 10, expected 0 to 9"));
  EXPECT_THAT(faults(R"({"model_archive":"../x"})"), ElementsAre(HasSubstr("model_archive")));
  EXPECT_THAT(faults(R"({"settings":[]})"), ElementsAre(HasSubstr("settings is []")));
  EXPECT_THAT(faults(R"({"video":3})"), ElementsAre(HasSubstr("video is not an object")));
  EXPECT_THAT(faults(R"({"video":{"preset":"-y"}})"), ElementsAre(HasSubstr("video.preset")));
  EXPECT_THAT(faults(R"({"video":{"crf":1e300}})"), ElementsAre(HasSubstr("video.crf")));
  EXPECT_THAT(faults(R"({"video":{"ffmpeg":"/tmp/x"}})"),
              ElementsAre("with video.ffmpeg, which is never recorded"));
}

TEST(DescriptionChecks, PlacesOfStreams) {
  const auto found = listed_places(nlohmann::json::parse(
      R"json({"streams":["qpos uint8(2000,)","robot/eye uint8(12, 16, 3)","flag bool()",7]})json"));
  ASSERT_EQ(found.size(), 3);
  EXPECT_THAT(found[0].places, ElementsAre("obs/agent/qpos", "obs/sensor_data/qpos"));
  EXPECT_THAT(found[1].places, ElementsAre("obs/extra/robot/eye", "obs/sensor_data/robot_eye"));
  EXPECT_EQ(found[2].name, "flag");
}

TEST(DescriptionChecks, StreamsThatARenderingCarriesOver) {
  const auto found = listed_places(nlohmann::json::parse(
      R"json({"streams":["eye uint8(4, 4, 3)"],"settings":{"render":{"carried":["replay/state float64(9,)"]}}})json"));
  ASSERT_EQ(found.size(), 2);
  EXPECT_THAT(found[1].places, ElementsAre("replay/state", "obs/sensor_data/replay_state"));
  EXPECT_THAT(listed_places(nlohmann::json::parse(R"({"settings":{"render":[]}})")), IsEmpty());
}

}  // namespace
}  // namespace mjsense::replay
