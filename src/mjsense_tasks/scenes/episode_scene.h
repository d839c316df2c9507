// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene file (scene_file.h) prepared for episodes: the configuration it is compiled from, its
// objects, and their placement at the start of an episode. All variation is a function of (seed,
// episode).

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/scene/scene.h"
#include "mjsense_tasks/episode/given_start.h"
#include "mjsense_tasks/episode/object_shape.h"
#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/robots/state_row.h"
#include "mjsense_tasks/scenes/object_meshes.h"
#include "mjsense_tasks/scenes/object_placement.h"
#include "mjsense_tasks/scenes/object_sizes.h"
#include "mjsense_tasks/scenes/scene_file.h"
#include "mjsense_tasks/scenes/scene_variation.h"

namespace mjsense::tasks::scenes {

// A body with a free joint that a task may refer to.
struct SceneObject {
  int body = -1;
  std::string kind;                 // last part of the name: "mug"
  std::string text;                 // name in instructions
  std::vector<std::string> others;  // further names in instructions
  std::vector<Quat> rests;
  episode::ObjectShape shape;  // in the size of its model
  bool receptacle = false;     // objects can be put in or on it
  std::string color;
  std::string material;                      // adjective in instructions; "": unknown
  std::vector<double> sizes;                 // possible scale factors
  std::vector<episode::ObjectShape> shapes;  // for each of `sizes`
};

class EpisodeScene {
 public:
  // Generates the house of a scene with a generator, and loads the models of entities that get a
  // free joint. Throws ValueError.
  explicit EpisodeScene(SceneFileCfg cfg);

  const SceneFileCfg& cfg() const { return cfg_; }
  // The scene with an empty entity named `robot` after the first entity, which the caller fills in.
  scene::SceneCfg scene_cfg(const std::string& robot) const;
  // Finds objects and surfaces. Bodies of the robot, whose names start with `robot_prefix`, are not
  // objects. Throws KeyError, ValueError. For a scene without objects, only object() throws.
  void initialize(const mjModel* model, int num_worlds, std::string_view robot_prefix);
  // Connects the scene's variation to the worlds. The simulation must outlive this object. Throws
  // KeyError, ValueError.
  void bind(sim::Simulation& simulation);
  // Replaces the height (m) of the robot's base that the scene file specifies.
  void put_robot_at(double height) { cfg_.robot.pos[2] = height; }

  std::span<const SceneObject> objects() const { return objects_; }
  std::span<const Region> regions() const { return regions_; }
  // Regions at the current positions of the furniture in this world.
  std::vector<Region> regions_of(int world) const;
  // Limits targets to some regions: one flag per region, at least one of them true.
  void set_target_regions(std::span<const char> flags);
  // Whether an object is present in this world's episode. Absent objects are held at rest far away:
  // they do not fall and touch nothing.
  bool present(int world, int object) const { return present_[world * objects_.size() + object]; }

  // Bodies of the objects that are absent from some episodes.
  std::vector<int> absentees() const;
  // Whether a body is present in this world's episode; true for bodies that are not objects.
  bool body_present(int world, int body) const;

  // Shape at the object's size in the current episode of this world. Valid for the lifetime of the
  // scene.
  const episode::ObjectShape& shape(int world, int object) const;
  double size(int world, int object) const;

  // Height (m) of the surface under the target at the start of this world's episode.
  double support_height(int world) const { return support_[world]; }

  // Samples the start of an episode: writes the objects' joints and returns the pose of the robot's
  // base. `target` is the object of the task, or -1. Positions are drawn from `rng`.
  Pose sample(int world, int target, std::uint64_t seed, std::uint64_t episode, Rng& rng,
              const robots::StateRow& state);
  // Like sample() with one target, for several objects of the task: all are present and in the
  // target area. The first one is the target.
  Pose sample(int world, std::span<const int> wanted, std::uint64_t seed, std::uint64_t episode,
              Rng& rng, const robots::StateRow& state);
  // A start without random variation: all objects that an episode would place are absent. Returns
  // the pose of the robot's base.
  Pose clear(const robots::StateRow& state) const;
  // For a state that another instance of this scene has sampled: adopts which objects are present
  // and their sizes. Returns their indices.
  std::vector<int> adopt(int world, std::uint64_t seed, std::uint64_t episode,
                         const robots::StateRow& state);
  // The same for a given start. Its absent objects are moved away, and so are objects without a pose
  // in it, if the scene places its objects.
  void adopt(int world, std::uint64_t seed, std::uint64_t episode, const episode::GivenStart& start,
             const robots::StateRow& state);
  // Draws one of these objects uniformly. If no hand of the robot can grasp it at its size in this
  // world's episode, another one is drawn, as long as there is one.
  int draw(int world, std::span<const int> of, const robots::Robot& robot, Rng& rng) const;
  // Makes an object the target of the episode, at its position in `state`.
  void set_target(int world, int target, const robots::StateRow& state);
  // Indices of the objects to pick up, and of the receptacles.
  std::vector<int> pickup_objects() const { return where(false); }
  std::vector<int> receptacles() const { return where(true); }
  // Varies lights, colours, furniture and object sizes; call it before sample(). Returns false if
  // nothing varies.
  bool vary(int world, std::uint64_t seed, std::uint64_t episode);
  // Name of the mood of an episode's lights and colours; empty if the scene has none.
  std::string mood(std::uint64_t seed, std::uint64_t episode) const;
  // Displacements (world frame) between which the random placement of furniture can move this geom,
  // itself or with a parent body. Empty if it does not move.
  std::vector<Pose> elsewhere(int geom) const;
  // Checks the start state of a world: an object must not penetrate anything by more than 2 mm.
  // Returns a description of the fault, or "".
  std::string fault(const World& world) const;

 private:
  // Whether `count` selects a subset of the objects.
  bool counts_objects() const;
  // Whether the entity is an object that every episode places.
  bool is_placed(const SceneEntityCfg& entity) const;
  void find_objects(std::string_view robot_prefix);
  void collect_objects(std::string_view robot_prefix);
  void find_regions();
  void put(int object, const Pose& pose, const robots::StateRow& state) const;
  void find_furniture();
  void make_meshes();
  void make_sizes();
  void draw_sizes(int world, std::uint64_t seed, std::uint64_t episode);
  std::vector<int> where(bool receptacle) const;
  std::string context() const;

  SceneFileCfg cfg_;
  const mjModel* model_ = nullptr;
  scene::ModelSource generated_;                 // empty if the scene has no generator
  std::vector<std::shared_ptr<mjSpec>> edited_;  // models that the scene changes
  std::shared_ptr<const ObjectMeshes> meshes_;   // null: object sizes do not vary
  std::vector<SceneObject> objects_;
  std::vector<Region> regions_;
  std::vector<int> region_bodies_;         // the body that carries each region
  std::map<int, SceneVaryCfg> furniture_;  // variation of each furniture body
  std::vector<char> present_;              // [B, objects]
  std::vector<int> steps_;                 // [B, objects] index into `sizes`; -1: size of the model
  std::vector<double> support_;            // [B]
  sim::Simulation* simulation_ = nullptr;
  std::unique_ptr<SceneVariation> variation_;
  std::unique_ptr<ObjectSizes> sizes_;
};

}  // namespace mjsense::tasks::scenes
