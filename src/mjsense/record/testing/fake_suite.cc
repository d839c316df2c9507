// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/testing/fake_suite.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include "mjsense/core/error.h"
#include "mjsense/core/text/json.h"

namespace mjsense::record {
namespace {

struct Moment {
  int world;
  std::int64_t episode;
  int t, length;
};

class FakeSensor final : public Sensor {
 public:
  using Fill = std::function<void(FakeSensor&, const Moment&)>;
  FakeSensor(std::string name, Fill fill) : Sensor(std::move(name)), fill_(std::move(fill)) {}
  std::string_view kind() const override { return "fake"; }
  void initialize(const SensorInit&) override {}
  void compute(const World&) override {}
  void fill(const Moment& m) { fill_(*this, m); }

  Field& declare(std::string_view name, SensorSpec spec, int worlds) {
    return add_field(name, std::move(spec), worlds);
  }
  template <class T>
  std::span<T> row(int field, int world) {
    return fields()[field].data.row<T>(world);
  }

 private:
  Fill fill_;
};

SensorSpec spec_of(DType dtype, Shape shape, std::string unit, std::string frame,
                   std::string description) {
  SensorSpec spec;
  spec.dtype = dtype;
  spec.shape = shape;
  spec.unit = std::move(unit);
  spec.frame = std::move(frame);
  spec.description = std::move(description);
  return spec;
}

SensorSpec dict_spec(int size) {
  SensorSpec spec = spec_of(DType::kUint8, {size}, "", "", "JSON text");
  spec.is_dict = true;
  spec.str_max_len = size;
  return spec;
}

using WriteJson = std::function<void(JsonWriter&, const Moment&)>;

std::unique_ptr<FakeSensor> dict(const std::string& name, int size, int worlds, WriteJson write) {
  auto sensor = std::make_unique<FakeSensor>(name, [write, name](FakeSensor& s, const Moment& m) {
    JsonWriter json(s.row<std::uint8_t>(0, m.world));
    write(json, m);
    if (!json.finish()) throw std::logic_error(name + ": the text does not fit");
  });
  sensor->declare("", dict_spec(size), worlds);
  return sensor;
}

// Streams of an arm, a base without joints and a gripper. With `action`, no action is given at the
// last step.
std::unique_ptr<FakeSensor> groups(const std::string& name, bool action, int worlds) {
  auto sensor = std::make_unique<FakeSensor>(name, [action](FakeSensor& s, const Moment& m) {
    const bool given = !action || m.t + 1 < m.length;
    const auto arm = s.row<float>(0, m.world);
    for (int j = 0; j < 7; ++j) arm[j] = given ? FakeSuite::joint(m.episode, m.t, j) : 0;
    s.row<double>(2, m.world)[0] = given ? 0.00296 : 0;
    if (!action) return;
    for (int f = 3; f < 6; ++f) s.row<bool>(f, m.world)[0] = given;
  });
  sensor->declare("arm", spec_of(DType::kFloat32, {7}, "rad", "", "joints"), worlds);
  sensor->declare("base", spec_of(DType::kFloat32, {0}, "", "", "no joints"), worlds);
  sensor->declare("gripper", spec_of(DType::kFloat64, {1}, "rad", "", "driver"), worlds);
  for (const char* group : {"given/arm", "given/base", "given/gripper"}) {
    if (action) sensor->declare(group, spec_of(DType::kBool, {}, "", "", "there is one"), worlds);
  }
  return sensor;
}

template <class T>
std::unique_ptr<FakeSensor> numbers(const std::string& name, Shape shape, const char* unit,
                                    const char* frame, int worlds) {
  auto sensor = std::make_unique<FakeSensor>(name, [](FakeSensor& s, const Moment& m) {
    auto row = s.row<T>(0, m.world);
    for (std::size_t i = 0; i < row.size(); ++i)
      row[i] = static_cast<T>(m.episode * 1000 + m.t + 0.125 * static_cast<double>(i));
  });
  sensor->declare("", spec_of(dtype_of<T>(), shape, unit, frame, "a number that counts"), worlds);
  return sensor;
}

void paint(std::span<std::uint8_t> rgb, int width, int height, const Moment& m) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* p = &rgb[3 * (static_cast<std::size_t>(y) * width + x)];
      const bool ball =
          (x - 2 * m.t - 8) * (x - 2 * m.t - 8) + (y - height / 2) * (y - height / 2) <
          height * height / 16;
      p[0] = static_cast<std::uint8_t>(ball ? 220 : 40 + 120 * x / width);
      p[1] = static_cast<std::uint8_t>(ball ? 60 : 60 + 100 * y / height);
      p[2] = static_cast<std::uint8_t>(ball ? 40 + 20 * (m.episode % 8) : 120);
    }
  }
}

}  // namespace

FakeSuite::~FakeSuite() = default;

FakeSuite::FakeSuite(const FakeSuiteCfg& cfg) : cfg_(cfg) {
  const int B = cfg.num_worlds, W = cfg.width, H = cfg.height;
  for (int c = 0; c < cfg.cameras; ++c) {
    const std::string camera = c == 0 ? "wrist_camera" : fmt::format("exo_camera_{}", c);
    auto param = std::make_unique<FakeSensor>(
        "sensor_param_" + camera, [W, H](FakeSensor& s, const Moment& m) {
          auto M = s.row<double>(0, m.world), E = s.row<double>(1, m.world),
               K = s.row<double>(2, m.world);
          for (int i = 0; i < 4; ++i) M[5 * i] = 1;
          for (int i = 0; i < 3; ++i) E[5 * i] = 1;
          K[0] = K[4] = H / 2.0;
          K[2] = W / 2.0;
          K[5] = H / 2.0;
          K[8] = 1;
        });
    param->declare("cam2world_gl",
                   spec_of(DType::kFloat64, {4, 4}, "", "world", "camera pose, OpenCV axes"), B);
    param->declare("extrinsic_cv", spec_of(DType::kFloat64, {3, 4}, "", "camera", "its inverse"),
                   B);
    param->declare("intrinsic_cv", spec_of(DType::kFloat64, {3, 3}, "px", "pixels", "pinhole"), B);
    sensors_.push_back(std::move(param));
    if (cfg.rgb) {
      auto rgb = std::make_unique<FakeSensor>(camera, [W, H](FakeSensor& s, const Moment& m) {
        paint(s.row<std::uint8_t>(0, m.world), W, H, m);
      });
      SensorSpec spec = spec_of(DType::kUint8, {H, W, 3}, "", "pixels", "RGB picture");
      spec.storage = Storage::kRgbVideo;
      rgb->declare("", spec, B);
      sensors_.push_back(std::move(rgb));
    }
    if (cfg.depth) {
      auto depth =
          std::make_unique<FakeSensor>(camera + "_depth", [W, H](FakeSensor& s, const Moment& m) {
            auto row = s.row<float>(0, m.world);
            for (int y = 0; y < H; ++y) {
              for (int x = 0; x < W; ++x)
                row[static_cast<std::size_t>(y) * W + x] = FakeSuite::depth(x, y, m.t);
            }
            row[W - 1] = std::numeric_limits<float>::infinity();
          });
      SensorSpec spec =
          spec_of(DType::kFloat32, {H, W}, "m", "camera", "distance along the optical axis");
      spec.storage = Storage::kDepthVideo;
      depth->declare("", spec, B);
      sensors_.push_back(std::move(depth));
    }
  }
  sensors_.push_back(groups("qpos", false, B));
  sensors_.push_back(groups("qvel", false, B));
  sensors_.push_back(numbers<float>("robot_base_pose", {7}, "m, 1", "world", B));
  auto states = std::make_unique<FakeSensor>("env_states", [](FakeSensor& s, const Moment& m) {
    for (int f = 0; f < 2; ++f) {
      auto row = s.row<float>(f, m.world);
      for (std::size_t i = 0; i < row.size(); ++i)
        row[i] = static_cast<float>(m.t) + 0.5f * static_cast<float>(i);
    }
  });
  states->declare("actors/cup", spec_of(DType::kFloat32, {13}, "", "world", "pose and velocity"),
                  B);
  states->declare("articulations/panda",
                  spec_of(DType::kFloat32, {31}, "", "", "positions, velocities, zeros"), B);
  sensors_.push_back(std::move(states));
  sensors_.push_back(dict("task_info", 4000, B, [](JsonWriter& json, const Moment& m) {
    json.begin_object();
    json.key("position_error")
        .value(m.t == 0 ? std::numeric_limits<double>::infinity() : 0.5 / m.t);
    json.key("success").value(m.t + 1 == m.length);
    json.end_object();
  }));
  for (const char* name :
       {"commanded_action", "ee_pose", "ee_twist", "joint_pos", "joint_pos_rel"}) {
    sensors_.push_back(groups(fmt::format("actions/{}", name), true, B));
  }
  auto points =
      std::make_unique<FakeSensor>("object_image_points", [](FakeSensor& s, const Moment& m) {
        auto xy = s.row<float>(0, m.world);
        for (float& v : xy) v = std::numeric_limits<float>::quiet_NaN();
        xy[0] = xy[1] = 0.5f;
        s.row<std::int32_t>(1, m.world)[0] = 1;
      });
  points->declare(
      "pickup_obj/wrist_camera/points",
      spec_of(DType::kFloat32, {10, 2}, "", "pixels", "x, y as fractions; NaN if unused"), B);
  points->declare("pickup_obj/wrist_camera/num_points",
                  spec_of(DType::kInt32, {1}, "", "", "valid rows of points"), B);
  sensors_.push_back(std::move(points));
  auto grasp =
      std::make_unique<FakeSensor>("grasp_state_pickup_obj", [](FakeSensor& s, const Moment& m) {
        s.row<bool>(0, m.world)[0] = m.t > 3;
        s.row<bool>(1, m.world)[0] = m.t > 2;
      });
  grasp->declare("gripper/held", spec_of(DType::kBool, {}, "", "", "holds"), B);
  grasp->declare("gripper/touching", spec_of(DType::kBool, {}, "", "", "touches"), B);
  sensors_.push_back(std::move(grasp));
  sensors_.push_back(numbers<float>("tcp_pose", {7}, "m, 1", "robot base", B));
  sensors_.push_back(numbers<std::int64_t>("policy_phase", {}, "", "", B));
  sensors_.push_back(numbers<std::int64_t>("policy_num_retries", {}, "", "", B));
  sensors_.push_back(numbers<float>("robot/imu_acc", {3}, "m/s^2", "site robot/imu", B));
  sensors_.push_back(numbers<std::uint16_t>("tactile", {2, 3, 4}, "", "", B));
  auto touch = std::make_unique<FakeSensor>("feet/found", [](FakeSensor& s, const Moment& m) {
    auto row = s.row<bool>(0, m.world);
    for (std::size_t i = 0; i < row.size(); ++i) row[i] = (m.t + static_cast<int>(i)) % 3 == 0;
  });
  touch->declare("", spec_of(DType::kBool, {4}, "", "", "contact found"), B);
  sensors_.push_back(std::move(touch));
}

std::vector<const Sensor*> FakeSuite::sensors() const {
  std::vector<const Sensor*> all;
  for (const auto& s : sensors_) all.push_back(s.get());
  return all;
}

Sensor& FakeSuite::sensor(const std::string& name) {
  for (const auto& s : sensors_) {
    if (s->name() == name) return *s;
  }
  throw KeyError(fmt::format("no fake sensor '{}'", name));
}

void FakeSuite::fill(int world, std::int64_t episode, int t, int length) {
  for (const auto& s : sensors_) static_cast<FakeSensor&>(*s).fill({world, episode, t, length});
}

float FakeSuite::joint(std::int64_t episode, int t, int j) {
  return static_cast<float>(std::sin(0.1 * t + j) + 0.01 * static_cast<double>(episode));
}

float FakeSuite::depth(int x, int y, int t) {
  return x == 0 && y == 0 ? 0.0f : 0.3f + 0.001f * static_cast<float>(x + 2 * y + t);
}

std::string FakeSuite::obs_scene(std::int64_t episode) {
  return fmt::format(
      R"({{"task_type": "pick", "task_description": "Pick up the cup {}", "policy_dt_ms": 66, "text": "Pick up the cup", )"
      R"("object_name": "cup", "referral_expressions": {{"pickup_obj": [["the cup", 0.9]]}}, )"
      R"("policy_phases": {{"unknown": 0, "grasp": 3}}}})",
      episode);
}

}  // namespace mjsense::record
