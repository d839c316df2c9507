// SPDX-License-Identifier: Apache-2.0
#pragma once
// `env_states`: the state that is needed to restore the scene: every free body, the robot's joints,
// and those of articulated objects.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/joint_state.h"

namespace mjsense {

// Streams
//   env_states/articulations/<name>   float64 [nq + nv]: qpos, then qvel, of all joints of a
//                                     kinematic tree with internal joints, in model order, passive
//                                     joints included. Writing them back restores the tree exactly.
//                                     One stream for the robot, by the robot's name, and one for
//                                     each such tree of the scene, by the name of its root body.
//   env_states/actors/<name>          float32 [13]: position 3 (m), quaternion 4 (wxyz), velocity 6
//                                     (m/s in world axes, rad/s in body axes): MuJoCo's qpos and
//                                     qvel of the free joint. Writing them back restores the body.
//                                     One stream for each free body outside the robot.
//   env_states/articulations/<articulation>
//                                     float32 [N]: qpos of all groups in order, then their qvel,
//                                     then zeros: MolmoSpaces' row, if it is requested
// An actor has the name of its body without the entity's prefix ("mug" for "mug/mug") if that is
// unique. Otherwise it has the full name with '_' for '/', which would create a group in a file.
class EnvStatesSensor final : public Sensor {
 public:
  // `length`: N, at least the number of values of the groups; 0: exactly that number. `robot_body`:
  // free bodies at or below it are not actors; "": there is no such body. `articulation`: name of
  // MolmoSpaces' row; "": no such row. `robot`: name of the robot's float64 row; "": no float64
  // rows, neither of the robot nor of the scene.
  EnvStatesSensor(std::string name, std::string articulation, std::vector<JointGroup> groups,
                  int length, std::string robot_body, std::string robot = "");
  std::string_view kind() const override { return "env_states"; }
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  struct Actor {
    int qpos, dof;
  };
  struct Articulation {
    std::string name;
    std::vector<int> qpos, dof;
  };
  std::vector<Articulation> find_articulations(const mjModel* model, int robot_body) const;

  std::string articulation_, robot_;
  std::vector<JointGroup> groups_;
  int length_;
  std::string robot_body_;
  std::vector<Actor> actors_;                // field i belongs to actor i
  std::vector<Articulation> articulations_;  // their fields follow; MolmoSpaces' row is the last
};

}  // namespace mjsense
