// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene of data (scene_file.h) in which episodes are played: what it is compiled from, the
// objects in it, and their places at the start of an episode. Everything that differs is a function
// of (seed, episode).

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/episode/object_shape.h"
#include "mjsense/robots/robot.h"
#include "mjsense/robots/state_row.h"
#include "mjsense/scene/scene.h"
#include "mjsense/scenes/layout.h"
#include "mjsense/scenes/look.h"
#include "mjsense/scenes/object_meshes.h"
#include "mjsense/scenes/object_sizes.h"
#include "mjsense/scenes/scene_file.h"

namespace mjsense {

// A body with a free joint that a task may be about.
struct SceneObject {
  int body = -1;
  std::string kind;                 // last part of its name: "mug"
  std::string text;                 // what people call it
  std::vector<std::string> others;  // what else they call it
  std::vector<Quat> rests;
  ObjectShape shape;        // in the size of its model
  bool receptacle = false;  // things are put in or on it
  std::string color;
  std::vector<double> sizes;        // that it may have
  std::vector<ObjectShape> shapes;  // in these
};

class EpisodeScene {
 public:
  // Makes the house of a scene that is generated; reads the models of entities that get a free joint. Throws ValueError.
  explicit EpisodeScene(SceneFileCfg cfg);

  const SceneFileCfg& cfg() const { return cfg_; }
  // Everything but the robot, for which there is a place after the first entity, called `robot`.
  SceneCfg scene_cfg(const std::string& robot) const;
  // Finds objects and surfaces. Bodies of the robot, whose names start with `robot_prefix`, are no
  // objects. Throws KeyError, ValueError; in a scene without objects only object() does.
  void initialize(const mjModel* model, int num_worlds, std::string_view robot_prefix);
  // For what varies, once there are worlds; they live as long as this. Throws KeyError, ValueError.
  void bind(Simulation& simulation);
  // Instead of the height that the scene's file says, m.
  void put_robot_at(double height) { cfg_.robot.pos[2] = height; }

  std::span<const SceneObject> objects() const { return objects_; }
  std::span<const Region> regions() const { return regions_; }
  // Whether an object takes part in the episode of this world. The others are held far away: no gravity moves them and
  // they touch nothing.
  bool present(int world, int object) const { return present_[world * objects_.size() + object]; }

  // Bodies of the objects that are absent from some episodes, and whether a body takes part; one that is no object does.
  std::vector<int> absentees() const;
  bool body_present(int world, int body) const;

  // In the size that the object has in this world's episode; lives as long as the scene.
  const ObjectShape& shape(int world, int object) const;
  double size(int world, int object) const;

  // Height (m) of what the target stands on at the start of this world's episode.
  double support_height(int world) const { return support_[world]; }

  // The start of an episode, `target` the object that it is about, -1: none of them: writes the objects' joints and
  // returns where the robot's base stands. `rng` gives the places.
  Pose sample(int world, int target, std::uint64_t seed, std::uint64_t episode, Rng& rng,
              const StateRow& state);
  // The same, about several: they are there, and within reach; the first is the target.
  Pose sample(int world, std::span<const int> wanted, std::uint64_t seed, std::uint64_t episode,
              Rng& rng, const StateRow& state);
  // A start without what differs from episode to episode: no object that is laid out is there; returns where the
  // robot's base stands.
  Pose clear(const StateRow& state) const;
  // For a state that another one of this scene has sampled: takes over which objects are there, and in which size, and
  // returns their indices.
  std::vector<int> adopt(int world, std::uint64_t seed, std::uint64_t episode,
                         const StateRow& state);
  // One of these objects, any as likely; where no hand of the robot can go around what was drawn, in the size that it
  // has in this world's episode, another, as long as there is one.
  int draw(int world, std::span<const int> of, const Robot& robot, Rng& rng) const;
  // The episode is about this object, where it lies in that state.
  void set_target(int world, int target, const StateRow& state);
  // Indices of the objects to pick up, and of the receptacles.
  std::vector<int> things() const { return where(false); }
  std::vector<int> receptacles() const { return where(true); }
  // The episode's lights, colours, furniture and sizes of objects, before it is sampled; false if nothing varies.
  bool vary(int world, std::uint64_t seed, std::uint64_t episode);
  // Displacements in the world between which furniture takes this geom from episode to episode, itself or what carries it;
  // empty where it stands still.
  std::vector<Pose> elsewhere(int geom) const;
  // What is wrong with the start that this fresh world shows: an object inside something by more
  // than 2 mm. "" if nothing is.
  std::string fault(const World& world) const;

 private:
  // Whether `count` chooses among the objects.
  bool counts_objects() const;
  // Whether an entity is an object that every episode places.
  bool is_placed(const SceneEntityCfg& entity) const;
  void find_objects(std::string_view robot_prefix);
  void collect_objects(std::string_view robot_prefix);
  void find_regions();
  void put(int object, const Pose& pose, const StateRow& state) const;
  void find_furniture();
  std::vector<Region> regions_of(int world) const;
  void make_meshes();
  void make_sizes();
  void draw_sizes(int world, std::uint64_t seed, std::uint64_t episode);
  std::vector<int> where(bool receptacle) const;
  std::string place() const;

  SceneFileCfg cfg_;
  const mjModel* model_ = nullptr;
  ModelSource generated_;                        // empty: the scene has no generator
  std::vector<std::shared_ptr<mjSpec>> edited_;  // models of which the scene changes something
  std::shared_ptr<const ObjectMeshes> meshes_;   // null: nothing has sizes
  std::vector<SceneObject> objects_;
  std::vector<Region> regions_;
  std::vector<int> region_bodies_;         // what carries each
  std::map<int, SceneVaryCfg> furniture_;  // by body, how it varies
  std::vector<char> present_;              // [B, objects]
  std::vector<int> steps_;                 // [B, objects], of its sizes; -1: that of its model
  std::vector<double> support_;            // [B]
  Simulation* simulation_ = nullptr;
  std::unique_ptr<Look> look_;
  std::unique_ptr<ObjectSizes> sizes_;
};

}  // namespace mjsense
