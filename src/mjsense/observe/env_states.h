// SPDX-License-Identifier: Apache-2.0
#pragma once
// `env_states`: the state that is needed to restore the scene: every free body, the robot's joints,
// and those of articulated objects.

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/joint_state.h"

namespace mjsense::observe {

// The free bodies that can be absent from an episode, and a function that tells whether one of them
// is present in a world's episode.
struct Presence {
  std::vector<int> bodies;
  std::function<bool(int world, int body)> present;
};

// Bodies with a free joint and the names of their actors, in the order of the joints. Bodies at or
// below the body `robot` are excluded; -1: none are.
std::vector<std::pair<int, std::string>> actors_of(const mjModel* model, int robot);

// Streams
//   env_states/articulations/<name>   float64 [nq + nv]: qpos, then qvel, of all joints of a
//                                     kinematic tree with internal joints, in model order, passive
//                                     joints included. Writing them back restores the tree exactly.
//                                     One stream for the robot, by the robot's name, and one for
//                                     each such tree of the scene, by the name of its root body.
//   env_states/actors/<name>          float32 [13]: position 3 (m), quaternion 4 (wxyz), velocity 6
//                                     (m/s in world axes, rad/s in body axes): MuJoCo's qpos and
//                                     qvel of the free joint. Writing them back restores the body.
//                                     One stream for each free body outside the robot. Zeros while
//                                     the body is absent
//   env_states/present/<name>         bool []: whether the actor is present in the episode; one
//                                     stream for each actor, and for each articulation with a free
//                                     joint, that can be absent. Recordings have one for everything
//   env_states/articulations/<peer>   float32 [N]: qpos of all groups in order, then their qvel,
//                                     then zeros: MolmoSpaces' row, only if it is configured
// The name of an actor is that of its body without the entity's prefix ("mug" for "mug/mug"). If
// this is not unique, it is the full name with '/' replaced by '_', because '/' separates groups in
// HDF5.
class EnvStatesSensor final : public Sensor {
 public:
  // `length`: N, at least the number of values of the groups; 0: exactly that number. `robot_body`:
  // free bodies at or below it are not actors; "": there is no such body. `articulation`: name of
  // MolmoSpaces' row; "": no such row. `robot`: name of the robot's float64 row; "": no float64
  // rows, neither of the robot nor of the scene.
  EnvStatesSensor(std::string name, std::string articulation, std::vector<JointGroup> groups,
                  int length, std::string robot_body, std::string robot = "",
                  Presence presence = {});
  std::string_view kind() const override { return "env_states"; }
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  struct Actor {
    int qpos, dof;
    int body = -1;   // -1: it is never absent
    int field = -1;  // its flag
  };
  struct Articulation {
    std::string name;
    std::vector<int> qpos, dof;
    int body = -1;   // the body with the free joint, if it can be absent
    int field = -1;  // its flag
  };
  std::vector<Articulation> find_articulations(const mjModel* model, int robot_body) const;
  int flag_of(const std::string& name, int num_worlds);
  bool note_presence(int world, int body, int flag);

  std::string articulation_, robot_;
  std::vector<JointGroup> groups_;
  int length_;
  std::string robot_body_;
  Presence presence_;
  std::vector<Actor> actors_;  // field i belongs to actor i
  // Their fields follow those of the actors, then MolmoSpaces' row, then the flags.
  std::vector<Articulation> articulations_;
};

}  // namespace mjsense::observe
