// SPDX-License-Identifier: Apache-2.0
// sees SCENE.xml CAMERA: what that camera sees in the second of two worlds, as CAMERA.ppm.

#include <mjsense/mjsense.h>

#include <exception>
#include <fstream>
#include <iostream>
#include <memory>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "sees SCENE.xml CAMERA\n";
    return 2;
  }
  auto camera = std::make_shared<mjsense::sensors::CameraSensorCfg>();
  camera->name = "picture";
  camera->camera_name = argv[2];
  camera->width = 320;
  camera->height = 240;
  camera->use_shadows = true;

  mjsense::scene::SceneCfg cfg;
  cfg.base.path = argv[1];
  cfg.sensors = {camera};
  auto scene = std::make_shared<mjsense::scene::Scene>(std::move(cfg));
  mjsense::sim::Simulation sim(scene, {.num_worlds = 2, .decimation = 5});
  sim.step();

  mjsense::Sensor& picture = scene->sensor("picture");
  sim.refresh(picture);  // all worlds; rows stay valid until the next refresh
  const auto rgb = picture.field("rgb").data.row<std::uint8_t>(1);
  std::ofstream out(std::string(argv[2]) + ".ppm", std::ios::binary);
  out << "P6 320 240 255\n";
  out.write(reinterpret_cast<const char*>(rgb.data()), static_cast<std::streamsize>(rgb.size()));
  return out ? 0 : 1;
} catch (const std::exception& error) {  // names the sensor, what was found, what was expected
  std::cerr << error.what() << "\n";
  return 1;
}
