// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/shared_field.h"

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"

namespace mjsense::observe {

SharedField::SharedField(std::string name, Sensor& source, std::string field,
                         std::function<void(SensorSpec&)> adapt)
    : Sensor(std::move(name)),
      source_(&source),
      field_(std::move(field)),
      adapt_(std::move(adapt)) {}

Stage SharedField::stage() const {
  return source_->stage() == Stage::kRow ? Stage::kRow : Stage::kPostCast;
}

void SharedField::initialize(const SensorInit& /*init*/) {
  clear_fields();
  if (field_.empty()) {
    for (Field& field : source_->fields()) share_field(field.name, field.spec, field);
    return;
  }
  const std::string context = "sensor '" + name() + "', which shows '" + source_->name() + "'";
  Field& field = find_named(source_->fields(), &Field::name, field_, context, "field");
  SensorSpec spec = field.spec;
  if (adapt_) adapt_(spec);
  share_field("", std::move(spec), field);
}

std::shared_ptr<Sensor> field_of_camera(std::string name, Sensor& camera, std::string field) {
  // Depth is [H, W, 1] in a camera and [H, W] in a video.
  const auto flat = [](SensorSpec& spec) {
    if (spec.storage == Storage::kDepthVideo) spec.shape = {spec.shape[0], spec.shape[1]};
  };
  return std::make_shared<SharedField>(std::move(name), camera, std::move(field), flat);
}

}  // namespace mjsense::observe
