// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense scan SCENE.xml --frame site:head --out cloud.ply`: writes a lidar scan as a point cloud.

#include <string>

#include "mjsense/sensors/lidar/lidar_sensor.h"

namespace mjsense::app {

struct ScanOptions {
  std::string scene;  // an MJCF file
  // "site:head": type and name of the element in the MJCF file that carries the lidar
  std::string frame;
  std::string out;  // .ply or .pcd
  sensors::SpinningScan spinning;
  sensors::TableScan table;       // used if it names a file
  sensors::LidarSensorCfg lidar;  // its frame and scan are replaced by the options above
  int steps = 0;                  // physics steps before the scan
  bool world = false;             // points in the world frame instead of the lidar's frame
};

int run_scan(const ScanOptions& options);

}  // namespace mjsense::app
