// SPDX-License-Identifier: Apache-2.0
// Bindings of the recorder for user-defined loops. python/mjsense/recording/recorder.py defines the public
// class.

#include "mjsense/record/recorder.h"

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/observe/shared_field.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/python_sensor.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {
namespace {

// Rows that Python writes: the measurements of a program without a Simulation.
class WrittenRows final : public Sensor {
 public:
  WrittenRows(std::string name, SensorSpec spec, int num_worlds) : Sensor(std::move(name)) {
    add_field("", std::move(spec), num_worlds);
  }
  std::string_view kind() const override { return "python"; }
  void initialize(const SensorInit& /*init*/) override {}
  void compute(const World& /*world*/) override {}
};

class PyRecorder {
 public:
  // `simulation` is None if all sensors are rows that Python writes.
  PyRecorder(nb::object simulation, int num_worlds, nb::list handles, const std::string& out,
             std::int64_t fps_num, std::int64_t fps_den, const std::string& settings,
             nb::dict options)
      : sim_(simulation.is_none() ? nullptr : &nb::cast<PySimulation&>(simulation)),
        simulation_(simulation),
        num_worlds_(num_worlds) {
    record::RecordingCfg cfg;
    cfg.out_dir = out;
    cfg.num_worlds = num_worlds;
    cfg.fps = {fps_num, fps_den};
    cfg.settings = settings;
    if (sim_) cfg.model = sim_->open().model();
    if (options.contains("archive")) {
      const auto archive = nb::cast<nb::tuple>(options.attr("pop")("archive"));
      const auto bytes = nb::cast<nb::bytes>(archive[1]);
      cfg.archive_name = nb::cast<std::string>(archive[0]);
      cfg.archive.assign(bytes.c_str(), bytes.size());
    }
    read_options(options, struct_of<record::FilesCfg>(), static_cast<record::FilesCfg*>(&cfg));
    for (nb::handle handle : handles) add(nb::cast<SensorHandle&>(handle).sensor);
    for (const auto& sensor : sensors_) cfg.sensors.push_back(sensor.get());
    nb::gil_scoped_release unlock;
    recorder_ = make_shared_guarded<record::Recorder>(cfg);
  }
  ~PyRecorder() {
    nb::gil_scoped_release unlock;
    recorder_.reset();
  }

  void begin(int world, std::int64_t episode, std::uint64_t seed) {
    check(world);
    unlocked([&] { recorder_->begin_episode(world, {.episode = episode, .seed = seed}); });
  }
  void append(const std::vector<int>& worlds, const std::vector<double>& reward,
              const std::vector<bool>& terminated, const std::vector<bool>& truncated,
              const std::vector<bool>& success) {
    for (int w : worlds) check(w);
    std::vector<Sensor*> fresh;
    for (const auto& sensor : sources_) fresh.push_back(sensor.get());
    if (sim_) sim_->read([&](sim::Simulation& sim) { sim.refresh(fresh, worlds); });
    unlocked([&] {
      for (std::size_t i = 0; i < worlds.size(); ++i) {
        recorder_->append(worlds[i], {.reward = static_cast<float>(reward[i]),
                                      .terminated = terminated[i],
                                      .truncated = truncated[i],
                                      .success = success[i]});
      }
    });
  }
  void finish(int world, const std::string& scene, const std::string& outcome) {
    check(world);
    unlocked([&] { recorder_->finish_episode(world, scene, outcome); });
  }
  void carry_over(int world, const std::string& file, const std::string& trajectory,
                  const std::vector<std::string>& skip) {
    check(world);
    unlocked([&] { recorder_->carry_over(world, {file, trajectory, skip}); });
  }
  void skip(std::int64_t episode, const std::string& why) {
    unlocked([&] { recorder_->skip_episode(episode, why); });
  }
  void discard(int world, const std::string& why) {
    check(world);
    unlocked([&] { recorder_->discard_episode(world, why); });
  }
  void abandon(int world) {
    check(world);
    unlocked([&] { recorder_->abandon_episode(world); });
  }
  void flush() {
    unlocked([&] { recorder_->flush(); });
  }
  void complete() {
    unlocked([&] { recorder_->complete(); });
  }

  record::Recorder& recorder() { return *recorder_; }
  bool recording(int world) const {
    check(world);
    return recorder_->recording(world);
  }

 private:
  template <class Body>
  void unlocked(Body&& body) {
    process_.check("recorder");
    nb::gil_scoped_release unlock;
    body();
  }
  void check(int world) const {
    if (sim_) sim_->open();
    if (world < 0 || world >= num_worlds_)
      throw ValueError(fmt::format("world {}: must be in [0, {})", world, num_worlds_));
  }
  // A camera with rgb or depth becomes videos plus its other fields, as in recordings of tasks.
  void add(const std::shared_ptr<Sensor>& sensor) {
    if (!dynamic_cast<const WrittenRows*>(sensor.get())) sources_.push_back(sensor);
    const auto has = [&](std::string_view field) {
      return std::ranges::find(sensor->fields(), field, &Field::name) != sensor->fields().end();
    };
    if (sensor->kind() != "camera" || !(has("rgb") || has("depth"))) {
      sensors_.push_back(sensor);
      return;
    }
    for (const Field& field : sensor->fields()) {
      const std::string suffix = field.name == "rgb" ? "" : "_" + field.name;
      sensors_.push_back(observe::field_of_camera(sensor->name() + suffix, *sensor, field.name));
      sensors_.back()->initialize({.model = nullptr, .num_worlds = num_worlds_});
    }
  }

  PySimulation* sim_;      // null if there is none
  nb::object simulation_;  // keeps the simulation alive
  int num_worlds_;
  std::vector<std::shared_ptr<Sensor>> sources_;  // sensors to refresh
  std::vector<std::shared_ptr<Sensor>> sensors_;  // sensors to store
  const ProcessGuard process_{};
  std::shared_ptr<record::Recorder> recorder_;
};

nb::dict stats(PyRecorder& self) {
  const record::RecordStats s = self.recorder().stats();
  nb::dict d;
  d["rows"] = s.rows;
  d["frames"] = s.frames;
  d["raw_bytes"] = s.raw_bytes;
  d["published_bytes"] = s.published_bytes;
  d["copy_s"] = s.copy_s;
  d["wait_s"] = s.wait_s;
  d["write_s"] = s.write_s;
  d["commit_s"] = s.commit_s;
  d["encode_cpu_s"] = s.encode_cpu_s;
  return d;
}

}  // namespace

void bind_recorder(nb::module_& m) {
  m.def(
      "written_rows",
      [](const std::string& name, nb::handle spec, int num_worlds) {
        return SensorHandle{std::make_shared<WrittenRows>(name, read_row_spec(spec), num_worlds)};
      },
      nb::arg("name"), nb::arg("spec"), nb::arg("num_worlds"),
      "A stream whose rows are written to SensorHandle.arrays(writable=True).");
  const auto world = nb::arg("world");
  nb::class_<PyRecorder>(m, "Recorder", "The C++ recorder.")
      .def(nb::init<nb::object, int, nb::list, const std::string&, std::int64_t, std::int64_t,
                    const std::string&, nb::dict>(),
           nb::arg("simulation").none(), nb::arg("num_worlds"), nb::arg("sensors"), nb::arg("out"),
           nb::arg("fps_num"), nb::arg("fps_den"), nb::arg("settings"), nb::arg("options"))
      .def("begin_episode", &PyRecorder::begin, world, nb::arg("episode"), nb::arg("seed"))
      .def("append", &PyRecorder::append, nb::arg("worlds"), nb::arg("reward"),
           nb::arg("terminated"), nb::arg("truncated"), nb::arg("success"))
      .def("finish_episode", &PyRecorder::finish, world, nb::arg("obs_scene"), nb::arg("outcome"))
      .def("carry_over", &PyRecorder::carry_over, world, nb::arg("file"), nb::arg("trajectory"),
           nb::arg("skip"),
           "Adds the data of a recorded episode that the running one does not have; call it before "
           "finish_episode().")
      .def("skip_episode", &PyRecorder::skip, nb::arg("episode"), nb::arg("why"),
           "Marks an attempt as decided and not kept.")
      .def("discard_episode", &PyRecorder::discard, world, nb::arg("why"))
      .def("abandon_episode", &PyRecorder::abandon, world)
      .def("flush", &PyRecorder::flush)
      .def("complete", &PyRecorder::complete)
      .def("recording", &PyRecorder::recording, world)
      .def("decided", [](PyRecorder& r, std::int64_t n) { return r.recorder().decided(n); })
      .def_prop_ro("first_attempt", [](PyRecorder& r) { return r.recorder().first_attempt(); })
      .def_prop_ro("kept", [](PyRecorder& r) { return r.recorder().kept(); })
      .def_prop_ro("discarded", [](PyRecorder& r) { return r.recorder().discarded(); })
      .def_prop_ro("enough", [](PyRecorder& r) { return r.recorder().has_all_episodes(); })
      .def_prop_ro("path", [](PyRecorder& r) { return r.recorder().house_dir().string(); })
      .def("stats", &stats);
}

}  // namespace mjsense::python
