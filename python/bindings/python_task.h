// SPDX-License-Identifier: Apache-2.0
#pragma once
// Adapter of a task written in Python (mjsense.Task, python/mjsense/tasks/task.py) for a rollout. Python
// is called once per step for all worlds, and at the start of an episode.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mjsense_tasks/episode/grasp_scene.h"
#include "mjsense_tasks/episode/task.h"
#include "python/bindings/rollout_host.h"

namespace mjsense::python {

class PythonTask final : public tasks::episode::Task, public tasks::episode::GraspScene {
 public:
  // `cfg`: settings of the rollout. Requires the GIL.
  static std::unique_ptr<PythonTask> make(nb::object task, std::shared_ptr<PythonHost> host,
                                          tasks::episode::TaskCfg cfg, bool own_horizon);

  // The user-defined object. Requires the GIL.
  nb::object object() const { return nb::borrow(task_.get()); }

  std::string_view name() const override { return name_; }
  std::string_view type() const override { return type_; }
  scene::SceneCfg scene_cfg() const override;
  std::string robot_entity() const override { return robot_entity_; }
  tasks::robots::ActuatorGroups robot_groups() const override { return groups_; }
  std::vector<tasks::robots::CameraMount> cameras() const override { return cameras_; }
  int start_key() const override { return model()->nkey > 0 ? 0 : -1; }
  void bind(const std::shared_ptr<sim::Simulation>& simulation) override {
    simulation_ = simulation;
  }

  void begin(const World& world) override;
  tasks::episode::Evaluation evaluate(const World& world) const override {
    return found_[world.id];
  }
  void begin_all(tasks::episode::ActiveWorlds& worlds) override;
  void evaluate_all(tasks::episode::ActiveWorlds& worlds,
                    std::span<tasks::episode::Evaluation> out) override;
  bool info_follows_evaluation() const override { return true; }

  std::span<const tasks::episode::TaskObject> objects(int world) const override {
    return objects_[world];
  }
  std::string description(int world) const override;
  Referrals referrals(int world) const override;
  Pose start_pose(int world, std::string_view role) const override;
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;
  void edit_suite(observe::SensorSuite& suite) const override;

  const tasks::episode::GraspScene* grasp_scene() const override {
    return graspable_.empty() ? nullptr : this;
  }
  std::span<const tasks::episode::GraspObject> all_objects() const override { return graspable_; }
  int target(int world) const override { return target_[world]; }
  double support_height(int /*world*/) const override { return table_height_; }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng,
                                   const tasks::robots::StateRow& state) override;
  bool samples_robot() const override { return true; }
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  // A value that evaluate() returns for every world in addition to reward and success.
  struct Info {
    char kind = 'f';             // bool, int or float, as NumPy's kind codes
    std::size_t width = 0;       // 0: one value per world, otherwise a list of this length
    std::vector<double> values;  // [B, max(width, 1)]
  };
  PythonTask(tasks::episode::TaskCfg cfg, nb::object task, std::shared_ptr<PythonHost> host);
  std::string place(const char* method) const;
  template <class Body>
  auto call(const char* method, Body&& body) const {
    return host_->call(place(method), std::forward<Body>(body));
  }
  std::size_t role_index(std::string_view role) const;
  void set_objects(int world, nb::handle roles);
  void read_info(nb::handle info);

  PyHandle task_;
  std::shared_ptr<PythonHost> host_;
  std::weak_ptr<sim::Simulation> simulation_;
  std::string name_, type_, robot_entity_;
  tasks::robots::ActuatorGroups groups_;
  std::vector<tasks::robots::CameraMount> cameras_;
  std::vector<std::vector<tasks::episode::TaskObject>> objects_;  // [B]
  std::vector<std::vector<Pose>> starts_;          // [B], initial poses of the objects
  std::vector<tasks::episode::Evaluation> found_;  // [B]
  std::map<std::string, Info> info_;
  std::vector<tasks::episode::GraspObject> graspable_;
  std::vector<int> target_;  // [B], index into graspable_
  double table_height_ = 0;
};

}  // namespace mjsense::python
