// SPDX-License-Identifier: Apache-2.0
// Bindings of camera systems, for rendering recorded episodes with other cameras.

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <functional>
#include <memory>

#include "mjsense_tasks/cameras/camera_system.h"
#include "mjsense_tasks/cameras/load_cameras.h"
#include "python/bindings/bindings.h"
#include "python/bindings/py_simulation.h"

namespace mjsense::python {
namespace {

class VisitHook final : public worlds::WorldHooks {
 public:
  explicit VisitHook(std::function<void(const World&)> body) : body_(std::move(body)) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override { body_(world); }

 private:
  std::function<void(const World&)> body_;
};

class PyCameraSystem {
 public:
  PyCameraSystem(const std::string& name_or_path, const std::string& robot_file,
                 const std::string& prefix, const std::string& base)
      : system_(tasks::cameras::load_camera_system(name_or_path, robot_file, prefix), prefix,
                base) {}

  nb::list mounts() const {
    nb::list out;
    for (std::size_t i = 0; i < system_.cfg().cameras.size(); ++i) {
      const tasks::cameras::CameraMountCfg& cfg = system_.cfg().cameras[i];
      const tasks::cameras::CameraSystem::Mounted& mounted = system_.mounted(static_cast<int>(i));
      std::array<double, 3> pos{};
      std::array<double, 4> quat{};
      write_vec(mounted.pose.p, pos.data());
      write_quat(mounted.pose.q, quat.data());
      nb::dict one;
      one["name"] = cfg.name;
      one["camera"] = mounted.camera;
      one["is_new"] = mounted.is_new;
      one["body"] = mounted.body;
      one["pos"] = pos;
      one["quat"] = quat;
      one["fovy"] = mounted.fovy;
      one["width"] = system_.width(static_cast<int>(i));
      one["height"] = system_.height(static_cast<int>(i));
      one["depth"] = cfg.depth;
      one["segmentation"] = cfg.segmentation;
      out.append(one);
    }
    return out;
  }
  void initialize(PySimulation& sim) {
    sim.change("cameras", [&](sim::Simulation& s) { system_.initialize(s); });
  }
  void set_size(int camera, int width, int height) { system_.set_size(camera, width, height); }
  bool varies() const { return system_.varies(); }
  std::string place(PySimulation& sim, int world, std::uint64_t seed, std::uint64_t episode,
                    const std::array<double, 3>& centre, const std::vector<int>& objects) {
    std::string why;
    sim.change("cameras", [&](sim::Simulation& s) {
      VisitHook hook([&](const World& w) {
        why = system_.place_cameras(w, seed, episode, vec3(centre.data()), objects);
      });
      const int worlds[] = {world};
      s.worlds().visit(worlds, hook);
      s.worlds().model_changed();
    });
    return why;
  }

 private:
  tasks::cameras::CameraSystem system_;
};

}  // namespace

void bind_cameras(nb::module_& m) {
  nb::class_<PyCameraSystem>(m, "CameraSystem", "The cameras of an episode.")
      .def(nb::init<const std::string&, const std::string&, const std::string&,
                    const std::string&>(),
           nb::arg("name_or_path"), nb::arg("robot_file"), nb::arg("prefix"), nb::arg("base"))
      .def("mounts", &PyCameraSystem::mounts, "Where each camera is mounted.")
      .def("set_size", &PyCameraSystem::set_size, nb::arg("camera"), nb::arg("width"),
           nb::arg("height"), "Sets the size of a camera's images, in pixels.")
      .def("initialize", &PyCameraSystem::initialize, nb::arg("simulation"))
      .def_prop_ro("varies", &PyCameraSystem::varies)
      .def("place", &PyCameraSystem::place, nb::arg("simulation"), nb::arg("world"),
           nb::arg("seed"), nb::arg("episode"), nb::arg("centre"), nb::arg("objects"),
           "Places the cameras of one world for an episode. Returns \"\" or the reason why a "
           "camera has no pose.");
}

}  // namespace mjsense::python
