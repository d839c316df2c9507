// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense scan SCENE.xml --frame site:head --out cloud.ply`: what a lidar sees, as a point cloud.

#include <string>

#include "mjsense/sensors/lidar/lidar_sensor.h"

namespace mjsense {

struct ScanOptions {
  std::string scene;  // an MJCF file
  std::string frame;  // "site:head": what carries the lidar, and its name in the file
  std::string out;    // .ply or .pcd
  SpinningScan spinning;
  TableScan table;       // if it names a file
  LidarSensorCfg lidar;  // but for its frame and scan
  int steps = 0;         // physics steps before the scan
  bool world = false;    // points in the world instead of the lidar's frame
};

int run_scan(const ScanOptions& options);

}  // namespace mjsense
