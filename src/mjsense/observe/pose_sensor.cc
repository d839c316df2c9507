// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/pose_sensor.h"

#include <fmt/format.h>

namespace mjsense::observe {

SensorSpec pose_spec(std::string frame, std::string description) {
  SensorSpec spec;
  spec.dtype = DType::kFloat32;
  spec.shape = {7};
  spec.unit = "m, wxyz";
  spec.frame = std::move(frame);
  spec.description = std::move(description);
  return spec;
}

PoseSensor::PoseSensor(std::string name, Ref frame, Ref reference, std::string description)
    : Sensor(std::move(name)),
      frame_ref_(std::move(frame)),
      reference_ref_(std::move(reference)),
      description_(std::move(description)) {}

void PoseSensor::initialize(const SensorInit& init) {
  const std::string context = fmt::format("sensor '{}'", name());
  frame_ = Frame::find(init.model, context, frame_ref_.type, frame_ref_.name);
  std::string in = "world";
  if (!reference_ref_.name.empty()) {
    reference_ = Frame::find(init.model, context, reference_ref_.type, reference_ref_.name);
    in = fmt::format("{} {}", reference_ref_.type, reference_ref_.name);
  }
  clear_fields();
  add_field("",
            pose_spec(in, description_.empty()
                              ? fmt::format("Pose of {} {}.", frame_ref_.type, frame_ref_.name)
                              : description_),
            init.num_worlds);
}

void PoseSensor::compute(const World& world) {
  Pose pose = frame_.pose(world.data);
  if (reference_.id >= 0) pose = inverse(reference_.pose(world.data)) * pose;
  const std::span<float> row = fields()[0].data.row<float>(world.id);
  const double cosine =
      pose.q.w * row[3] + pose.q.x * row[4] + pose.q.y * row[5] + pose.q.z * row[6];
  if (cosine < 0) pose.q = {-pose.q.w, -pose.q.x, -pose.q.y, -pose.q.z};
  write_pose(pose, row.data());
}

// The identity, to which every rotation with w >= 0 is nearer than its negative.
void PoseSensor::reset(const World& world) {
  write_pose(Pose{}, fields()[0].data.row<float>(world.id).data());
}

}  // namespace mjsense::observe
