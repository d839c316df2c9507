// SPDX-License-Identifier: Apache-2.0
#pragma once
// A task made of several child tasks in one scene. It succeeds if any child succeeds; its reward is
// the maximum of the children's rewards.

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mjsense_tasks/episode/task.h"

namespace mjsense::tasks {

class MultiTask : public episode::Task {
 public:
  // The first child samples the scene and provides the cameras; the others choose goals in that
  // scene. All children share this task's robot, policy and episodes. Throws ValueError for fewer
  // than two children, or if their scenes or robots differ.
  MultiTask(std::string name, episode::TaskCfg cfg,
            std::vector<std::unique_ptr<episode::Task>> children);
  std::string_view name() const override { return name_; }
  std::string_view type() const override { return "multi_task"; }
  scene::SceneCfg scene_cfg() const override { return children_[0]->scene_cfg(); }
  std::string robot_entity() const override { return children_[0]->robot_entity(); }
  robots::ActuatorGroups robot_groups() const override { return children_[0]->robot_groups(); }
  std::vector<robots::CameraMount> cameras() const override { return children_[0]->cameras(); }
  int start_key() const override { return children_[0]->start_key(); }
  void bind(const std::shared_ptr<sim::Simulation>& simulation) override {
    children_[0]->bind(simulation);
  }
  std::string start_error(const World& world) const override {
    return children_[0]->start_error(world);
  }

  void begin(const World& world) override;
  episode::Evaluation evaluate(const World& world) const override;
  void begin_all(episode::ActiveWorlds& worlds) override;
  void advance() override;
  void evaluate_all(episode::ActiveWorlds& worlds, std::span<episode::Evaluation> out) override;
  bool info_follows_evaluation() const override { return true; }

  // Objects of the first child, then those of later children. A later child's object is dropped if
  // its role is already taken. Referrals and sensors are merged in the same manner.
  std::span<const episode::TaskObject> objects(int world) const override { return objects_[world]; }
  std::string description(int world) const override;  // the children's, joined by " OR "
  std::vector<int> absentees() const override { return children_[0]->absentees(); }
  bool present(int world, int body) const override { return children_[0]->present(world, body); }
  std::string light(int world) const override { return children_[0]->light(world); }
  Referrals referrals(int world) const override;
  Pose start_pose(int world, std::string_view role) const override;
  std::optional<Pose> goal_pose(int world, std::string_view role) const override;
  // Writes success and tasks: {name: info of that child}. Repeated names are numbered: "pick_2".
  void write_info(const World& world, JsonWriter& json) const override;
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override;
  void edit_suite(observe::SensorSuite& suite) const override { children_[0]->edit_suite(suite); }
  std::span<const std::unique_ptr<episode::Task>> children() const override { return children_; }
  const episode::GraspScene* grasp_scene() const override;  // of the first child that has one

  int size() const { return static_cast<int>(children_.size()); }
  episode::Task& child(int index) { return *children_[index]; }
  const episode::Task& child(int index) const { return *children_[index]; }

 protected:
  void initialize_task() override;
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override;
  std::string paraphrase(const World& world, Rng& rng) const override;
  std::string paraphrase_of(int child, const World& world, Rng& rng) const;
  // Chooses the goals of the later children in the scene that the first one has sampled.
  virtual void choose_goals(int world, const robots::StateRow& state);
  // Evaluation of the whole; that of child i is `of_children[i * stride]`.
  virtual episode::Evaluation combined(int world, std::span<const episode::Evaluation> of_children,
                                       std::size_t stride) const;
  std::vector<std::pair<std::string, std::string>> scene_info(int world) const override;

 private:
  void collect_objects(int world);
  const episode::Task& with_role(std::string_view role) const;
  episode::Evaluation judge(int world, std::span<const episode::Evaluation> of_children,
                            std::size_t stride) const;

  std::string name_;
  std::vector<std::unique_ptr<episode::Task>> children_;
  std::vector<std::pair<std::string, int>> names_;  // unique names, sorted, with the child's index
  std::vector<std::vector<episode::TaskObject>> objects_;  // [B]
  mutable std::vector<char> success_;                      // [B], result of the last evaluation
  std::vector<episode::Evaluation> found_;                 // [children, B]
};

}  // namespace mjsense::tasks
