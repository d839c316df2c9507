// SPDX-License-Identifier: Apache-2.0
#pragma once
// One field of another sensor, or all, as a separate sensor. The rows are shared and not copied. For
// example, a camera of the scene appears in a suite as `wrist_camera` and `wrist_camera_depth`.

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "mjsense/core/sensor.h"

namespace mjsense::observe {

class SharedField final : public Sensor {
 public:
  // `field` "": all fields, under their names. `adapt` may change the spec of the one field: its storage,
  // or its shape to one with the same number of bytes.
  SharedField(std::string name, Sensor& source, std::string field = "",
              std::function<void(SensorSpec&)> adapt = {});
  std::string_view kind() const override { return "shared"; }
  Stage stage() const override;
  mjtStage needs() const override { return mjSTAGE_NONE; }
  std::span<Sensor* const> inputs() const override { return {&source_, 1}; }
  void initialize(const SensorInit& init) override;
  void compute(const World& /*world*/) override {}

 private:
  Sensor* source_;
  std::string field_;
  std::function<void(SensorSpec&)> adapt_;
};

// A field of a camera as recordings have it: rgb and depth are videos.
std::shared_ptr<Sensor> field_of_camera(std::string name, Sensor& camera, std::string field);

}  // namespace mjsense::observe
