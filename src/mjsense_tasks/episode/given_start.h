// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starts of episodes that are given by the caller, instead of being sampled.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/state_row.h"

namespace mjsense::tasks::episode {

// Members that are left out keep what was sampled. Names of bodies and joints are those of the model, or
// their part after a '/', if no other name of the model ends with it.
struct GivenStart {
  std::map<std::string, Pose> bodies;                // of free bodies, in the world frame
  std::vector<std::string> absent;                   // free bodies that the episode does not have
  std::map<std::string, double> joints;              // hinges and slides: rad or m
  std::map<std::string, std::vector<double>> robot;  // joint positions of move groups
  std::optional<Pose> base;                          // X_WB of the robot
  std::map<std::string, std::string> objects;        // role -> body
  std::map<std::string, double> thresholds;          // of success, by MolmoSpaces' names
  std::string instruction;                           // "": the task's
  std::string cameras;  // as CameraSystem::frozen() writes them; "": none
};
using GivenStarts = std::map<std::int64_t, GivenStart>;  // by number of the episode

// Reads a JSON object of starts by number, whose members are those of GivenStart; poses are x y z qw
// qx qy qz. Throws ValueError.
GivenStarts read_starts(std::string_view json);

// The body or joint with this name; -1: there is none, or there are several.
int find_name(const mjModel* model, mjtObj type, std::string_view name);

// Throws one ValueError that lists every body and joint that the model does not have, or that cannot
// be moved: bodies without a free joint can only be where they are. `context` begins the message.
void check_names(const mjModel* model, const GivenStarts& starts, std::string_view context);

// Writes the poses of the bodies and the positions of the joints, at rest.
void write_start(const mjModel* model, const GivenStart& start, const robots::StateRow& state);

}  // namespace mjsense::tasks::episode
