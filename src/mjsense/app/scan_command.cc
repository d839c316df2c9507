// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/scan_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mjsense/app/scene_file.h"
#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/lidar/point_cloud.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::app {

int run_scan(const ScanOptions& options) {
  const std::size_t colon = options.frame.find(':');
  if (colon == std::string::npos)
    throw ValueError(
        fmt::format("--frame {}: expected a type and a name, such as site:head", options.frame));
  auto lidar = std::make_shared<sensors::LidarSensorCfg>(options.lidar);
  lidar->name = "scan";
  lidar->frame = {{options.frame.substr(0, colon), options.frame.substr(colon + 1), ""}};
  if (options.table.file.empty())
    lidar->scan = options.spinning;
  else
    lidar->scan = options.table;

  if (!names_model(options.scene, "an MJCF file"))
    throw ValueError(fmt::format("'{}': no such file", options.scene));
  scene::SceneCfg cfg;
  cfg.base.path = options.scene;
  cfg.sensors.push_back(lidar);
  const auto scene = std::make_shared<scene::Scene>(std::move(cfg));
  print_warnings(*scene);
  sim::Simulation simulation(scene, {.decimation = std::max(1, options.steps)});
  if (options.steps > 0) simulation.step();
  check_physics(simulation, options.scene);
  Sensor& sensor = scene->sensor("scan");
  simulation.refresh(sensor);
  const auto rows = [&](const char* field) { return sensor.field(field).data.row<float>(0); };
  const std::span<const float> distances = rows("distances");
  sensors::write_point_cloud(options.out, rows(options.world ? "hit_pos_w" : "points"),
                             rows("intensity"), distances);
  const auto returns =
      std::count_if(distances.begin(), distances.end(), [](float t) { return t >= 0; });
  fmt::print("{}: {} of {} rays returned\n", options.out, returns, distances.size());
  return 0;
}

}  // namespace mjsense::app
