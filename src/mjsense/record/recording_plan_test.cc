// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_plan.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/record/depth_encoding.h"
#include "mjsense/record/molmospaces.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::record {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Plain final : public Sensor {
 public:
  Plain(std::string name, SensorSpec spec, std::string field = "") : Sensor(std::move(name)) {
    add_field(field, std::move(spec), 2);
  }
  std::string_view kind() const override { return "plain"; }
  void initialize(const SensorInit&) override {}
  void compute(const World&) override {}
};

SensorSpec spec(DType dtype, Shape shape, Storage storage = Storage::kArray) {
  SensorSpec s;
  s.dtype = dtype;
  s.shape = shape;
  s.storage = storage;
  return s;
}

RecordingPlan plan(std::initializer_list<const Sensor*> sensors) {
  RecordingCfg cfg;
  cfg.num_worlds = 2;
  cfg.sensors = sensors;
  return plan_recording(cfg);
}

TEST(Layout, StreamPathsEqualMolmoSpaces) {
  EXPECT_EQ(path_of("qpos"), "obs/agent/qpos");
  EXPECT_EQ(path_of("qvel"), "obs/agent/qvel");
  EXPECT_EQ(path_of("qpos_extra"), "obs/extra/qpos_extra");
  EXPECT_EQ(path_of("actions/joint_pos"), "actions/joint_pos");
  EXPECT_EQ(path_of("sensor_param_wrist/cam2world_gl"), "obs/sensor_param/wrist/cam2world_gl");
  EXPECT_EQ(path_of("env_states/actors/cup"), "env_states/actors/cup");
  EXPECT_EQ(path_of("object_image_points/cup/wrist/points"),
            "obs/extra/object_image_points/cup/wrist/points");
  // MolmoSpaces drops every stream with "camera" or "_depth" in its name.
  EXPECT_EQ(path_of("camera_shake"), "obs/extra/camera_shake");
  EXPECT_EQ(path_of("water_depth"), "obs/extra/water_depth");
}

TEST(Layout, NumbersPerMoveGroupAreJsonRows) {
  const Plain qpos("qpos", spec(DType::kFloat32, {7}), "arm");
  const RecordingPlan p = plan({&qpos});
  ASSERT_EQ(p.arrays.size(), 2u);  // the second are the numbers
  EXPECT_EQ(p.arrays[0].path, "obs/agent/qpos");
  EXPECT_EQ(p.arrays[0].kind(), "json");
  EXPECT_EQ(p.arrays[0].spec.shape, Shape({2000}));
  EXPECT_EQ(p.arrays[0].row_bytes(), 2000u);
  EXPECT_EQ(p.arrays[0].kept_bytes(), 28u);
  // A single field, an image or a sensor of another name is not converted to text.
  const Plain row("qvel", spec(DType::kFloat32, {7})),
      picture("grasp_state_cup", spec(DType::kFloat32, {4, 4}), "gripper"),
      other("joints", spec(DType::kFloat32, {7}), "arm");
  const RecordingPlan plain = plan({&row, &picture, &other});
  for (const ArrayStream& stream : plain.arrays) EXPECT_EQ(stream.kind(), "plain");
  EXPECT_EQ(plain.arrays[2].path, "obs/extra/joints/arm");
  // 80 numbers of 25 bytes exceed a row of text.
  const Plain many("qpos", spec(DType::kFloat32, {80}), "arm");
  EXPECT_EQ(error_of([&] { plan({&many}); }),
            "sensor 'qpos': its text can need 2012 bytes; its rows have 2000");
}

std::vector<int> batch_sizes(int episodes, int batches) {
  const Batches all = batches_of(episodes, batches);
  std::vector<int> sizes;
  for (int b = 0; b < all.count; ++b) sizes.push_back(all.size(b));
  return sizes;
}

TEST(Layout, BatchesEqualMolmoSpacesAndAreEven) {
  EXPECT_THAT(batch_sizes(8, 0), ElementsAre(4, 4));
  EXPECT_THAT(batch_sizes(1, 0), ElementsAre(1));
  EXPECT_THAT(batch_sizes(10, 0), ElementsAre(5, 5));        // Python: round(2.5) == 2
  EXPECT_THAT(batch_sizes(14, 0), ElementsAre(4, 4, 3, 3));  // Python: round(3.5) == 4
  EXPECT_THAT(batch_sizes(7, 3), ElementsAre(3, 2, 2));
  EXPECT_THROW(batch_sizes(0, 0), ValueError);
  EXPECT_THROW(batch_sizes(2, 3), ValueError);
  EXPECT_EQ(batch_file(0, 2), "trajectories_batch_1_of_2.h5");
  EXPECT_EQ(video_file(3, "wrist_camera_depth.mkv"), "episode_00000003_wrist_camera_depth.mkv");
}

TEST(Layout, FramesPerSecondAreExact) {
  EXPECT_EQ(Fps::from_period_ms(66), (Fps{500, 33}));
  EXPECT_EQ(Fps::from_period_ms(100), (Fps{10, 1}));
  EXPECT_EQ(Fps::from_period_ms(66).str(), "500/33");
  EXPECT_EQ(Fps::from_period_ms(500).str(), "2");
  EXPECT_THROW(Fps::from_period_ms(0), ValueError);
}

TEST(Layout, EveryFieldHasAPath) {
  FakeSuite suite({2, 8, 6});
  RecordingCfg cfg;
  cfg.num_worlds = 2;
  cfg.sensors = suite.sensors();
  std::size_t fields = 0;
  for (const Sensor* s : cfg.sensors) {
    const auto empty = [&](const Field& f) {  // the base has no joints
      return text_of(*s) && (f.spec.shape.size() == 0 || f.name == "given/base");
    };
    fields += s->fields().size() - std::ranges::count_if(s->fields(), empty);
    fields += text_of(*s) ? 1 : 0;
  }
  const RecordingPlan p = plan_recording(cfg);
  const auto added = [](const ArrayStream& a) {
    return !a.field && !a.text;
  };  // env_states/present
  EXPECT_EQ(p.arrays.size() + p.videos.size(), fields + std::ranges::count_if(p.arrays, added));
  cfg.video.molmospaces_depth = true;
  EXPECT_EQ(plan_recording(cfg).videos.size(), p.videos.size() + 1);
}

// The numbers of a sensor that is stored as JSON text are also datasets of their own.
TEST(Layout, JsonRowsHaveTheirNumbers) {
  struct Joints final : Sensor {
    Joints() : Sensor("qpos") {
      SensorSpec arm = spec(DType::kFloat32, {7});
      arm.unit = "rad";
      add_field("arm", arm, 2);
      add_field("base", spec(DType::kFloat32, {0}), 2);
      add_field("given/base", spec(DType::kBool, {}), 2);
    }
    std::string_view kind() const override { return "joints"; }
    void initialize(const SensorInit&) override {}
    void compute(const World&) override {}
  } joints;
  const RecordingPlan p = plan({&joints});
  ASSERT_EQ(p.arrays.size(), 2u);  // a group without joints has no numbers
  EXPECT_EQ(p.arrays[0].path, "obs/agent/qpos");
  EXPECT_TRUE(p.arrays[0].text);
  EXPECT_EQ(p.arrays[1].path, "numbers/obs/agent/qpos/arm");
  EXPECT_EQ(p.arrays[1].spec.unit, "rad");
  EXPECT_EQ(p.arrays[1].field, &joints.fields()[0]);
}

// An actor's row depends on its own flag; an actor without a flag is always present.
TEST(Layout, PresenceFlagsHaveTheirActors) {
  struct States final : Sensor {
    States() : Sensor("env_states") {
      for (const char* actor : {"actors/cup", "actors/mug"})
        add_field(actor, spec(DType::kFloat32, {13}), 2);
      add_field("present/mug", spec(DType::kBool, {}), 2);
      add_field("articulations/door", spec(DType::kFloat64, {2}), 2);
    }
    std::string_view kind() const override { return "states"; }
    void initialize(const SensorInit&) override {}
    void compute(const World&) override {}
  } states;
  const RecordingPlan p = plan({&states});
  ASSERT_EQ(p.arrays.size(), 6u);
  EXPECT_EQ(p.arrays[0].present, nullptr);
  EXPECT_EQ(p.arrays[1].present, &states.fields()[2]);
  EXPECT_EQ(p.arrays[2].path, "env_states/present/mug");
  // Constant flags of the others.
  EXPECT_EQ(p.arrays[4].path, "env_states/present/cup");
  EXPECT_EQ(p.arrays[5].path, "env_states/present/door");
  EXPECT_EQ(p.arrays[5].field, nullptr);
  EXPECT_EQ(p.arrays[5].row_bytes(), 1u);
}

TEST(Layout, StreamsCannotShareAPath) {
  const Plain a("feet", spec(DType::kFloat32, {3})), b("feet", spec(DType::kFloat32, {3}), "force");
  EXPECT_THAT(error_of([&] {
                plan({&a, &a});
              }),
              HasSubstr("would both be stored as 'obs/extra/feet'"));
  EXPECT_THAT(error_of([&] {
                plan({&a, &b});
              }),
              HasSubstr("'obs/extra/feet/force', inside 'obs/extra/feet'"));
  const Plain actors("env_states/actors", spec(DType::kFloat32, {3}));
  EXPECT_THAT(error_of([&] { plan({&actors}); }),
              HasSubstr("the layout and sensor 'env_states/actors'"));
  const Plain rgb("a/b", spec(DType::kUint8, {4, 4, 3}, Storage::kRgbVideo)),
      flat("a_b", spec(DType::kUint8, {4, 4, 3}, Storage::kRgbVideo));
  EXPECT_THAT(error_of([&] { plan({&rgb, &flat}); }), HasSubstr("'obs/sensor_data/a_b'"));
}

TEST(Layout, InvalidStreamsAreRefused) {
  const Plain empty("a//b", spec(DType::kFloat32, {})), dot("./a", spec(DType::kFloat32, {}));
  EXPECT_THAT(error_of([&] { plan({&empty}); }), HasSubstr("'a//b'"));
  EXPECT_THAT(error_of([&] { plan({&dot}); }), HasSubstr("'./a'"));
  const Plain grey("cam", spec(DType::kUint8, {4, 4, 1}, Storage::kRgbVideo));
  EXPECT_THAT(error_of([&] { plan({&grey}); }),
              HasSubstr("uint8(4, 4, 1), but an RGB video is uint8 (height, width, 3)"));
  const Plain depth("cam", spec(DType::kFloat64, {4, 4}, Storage::kDepthVideo));
  EXPECT_THAT(error_of([&] { plan({&depth}); }),
              HasSubstr("a depth video is float32 (height, width)"));
  RecordingCfg cfg;
  cfg.num_worlds = 3;
  cfg.sensors = {&grey};
  EXPECT_THAT(error_of([&] { plan_recording(cfg); }), HasSubstr("expected rows of 3 worlds"));
}

TEST(Layout, FingerprintDifferencesAreDescribed) {
  FakeSuite suite({2, 8, 6});
  RecordingCfg a, b;
  a.num_worlds = b.num_worlds = 2;
  a.sensors = b.sensors = suite.sensors();
  a.episodes = 8;
  b.episodes = 12;  // the number of batches follows
  a.settings = b.settings = R"({"task": "pick"})";
  const auto difference = [&] {
    return fingerprint_difference(plan_recording(a).fingerprint, plan_recording(b).fingerprint);
  };
  EXPECT_EQ(difference(), "'episodes' was 8 and is now 12");
  b.episodes = 8;
  b.video.max_encoders = 3;  // does not affect the files
  b.num_worlds = 1;
  EXPECT_EQ(difference(), "");
  b.settings = R"({"task": "place"})";
  EXPECT_EQ(difference(), "'settings/task' was \"pick\" and is now \"place\"");

  const std::string now = plan_recording(a).fingerprint;
  for (const char* library : {"mjsense", "mujoco"}) {
    nlohmann::json other = nlohmann::json::parse(now);
    other["versions"][library] = "0.0.9";
    other["streams"].clear();  // a consequence, which is not reported first
    EXPECT_THAT(fingerprint_difference(other.dump(), now),
                HasSubstr(fmt::format("'versions/{}' was \"0.0.9\" and is now ", library)));
  }
}

TEST(Depth, SixteenBitsAreExactToHalfAUnit) {
  constexpr float kInf = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> metres = {0.0f, -1.0f, kNan, kInf, 20.0f, 1e-6f, 0.0002f, 1.0f, 13.1f};
  std::vector<std::uint16_t> units(metres.size());
  encode_depth16(metres, 0.0002, units);
  EXPECT_THAT(units, ElementsAre(0, 0, 0, 65535, 65535, 1, 1, 5000, 65500));
  std::vector<float> many(20000);
  for (std::size_t i = 0; i < many.size(); ++i) many[i] = 0.01f + 0.00065f * static_cast<float>(i);
  std::vector<std::uint16_t> codes(many.size());
  encode_depth16(many, 0.0002, codes);
  for (std::size_t i = 0; i < many.size(); ++i)
    EXPECT_NEAR(codes[i] * 0.0002, many[i], 0.0001 + 2e-6);
}

TEST(Depth, RedGreenEqualsMolmoSpaces) {
  const std::vector<float> metres = {0.05f, 0.55f, 0.3f,
                                     0.04f, 0.56f, std::numeric_limits<float>::infinity()};
  std::vector<std::uint8_t> rgb(metres.size() * 3);
  encode_depth_red_green(metres, rgb);
  const auto code = [&](int i) { return rgb[3 * i] * 256 + rgb[3 * i + 1]; };
  EXPECT_EQ(code(0), 1);
  EXPECT_EQ(code(1), 65535);
  EXPECT_NEAR((code(2) - 1) / 65534.0 * 0.5 + 0.05, 0.3, 7.7e-6);
  EXPECT_EQ(code(3), 0);
  EXPECT_EQ(code(4), 0);
  EXPECT_EQ(code(5), 0);
}

// Such a text may come from an untrusted file: it is nested deeply enough to overflow any stack.
TEST(Fingerprint, InvalidTextIsNeverEqual) {
  const std::string ours = R"({"a":1})";
  const std::string deep =
      R"({"a":)" + std::string(1'000'000, '[') + std::string(1'000'000, ']') + "}";
  for (const std::string& other : {deep, std::string(5 << 20, ' ') + ours, std::string("[1"),
                                   std::string("[]"), std::string("\xff"), std::string()}) {
    EXPECT_EQ(fingerprint_difference(other, ours), "its description cannot be read");
    EXPECT_EQ(fingerprint_difference(ours, other), "its description cannot be read");
  }
}

}  // namespace
}  // namespace mjsense::record
