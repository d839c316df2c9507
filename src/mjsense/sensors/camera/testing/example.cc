// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense::sensors {

SensorCfgs camera_examples() {
  return {example<CameraSensorCfg>("eye",
                                   [](CameraSensorCfg& c) {
                                     c.camera_name = "robot/eye";
                                     c.width = 48;
                                     c.height = 32;
                                     c.data_types = {"rgb", "depth", "segmentation", "flow"};
                                     c.use_shadows = true;
                                   }),
          example<CameraSensorCfg>("flow", [](CameraSensorCfg& c) {
            c.camera_name = "robot/eye";
            c.width = 40;
            c.height = 40;
            c.data_types = {"flow", "normals", "body_segmentation", "entity_segmentation"};
            c.intrinsics = CameraIntrinsics{20, 20, 20, 20};
            c.distortion = {"fisheye", {0.01, 0, 0, 0}};
            c.update_period = 0.01;
          })};
}

}  // namespace mjsense::sensors
