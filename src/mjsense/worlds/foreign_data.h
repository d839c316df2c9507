// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays of another program that show fields of mjData, and from which the state is taken: the fields of
// mujoco_warp's Data, except its contacts.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <limits>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"

namespace mjsense::worlds {

// MuJoCo's function that is called for each world. kPositions: those that compute what follows from
// positions, without collisions.
enum class RawCall { kStep, kForward, kStep1, kStep2, kReset, kPositions };

class ForeignData {
 public:
  explicit ForeignData(int num_worlds) : num_constraints_(num_worlds) {}

  // Forgets all arrays. There are at most this many rows of constraints for each world.
  void clear(int max_constraints);
  // ForeignArrays::add_data(). The caller calls see_initial() for each world if `input`.
  bool add(const mjModel* m, std::string_view field, const ArrayView& rows, bool input);
  // The worlds have the model's initial state; the array that was added last may differ.
  void see_initial(const mjData* d, int w);

  // Takes what the program has written into the state. Returns whether anything was written on which
  // positions and velocities depend.
  bool take(mjData* d, int w) const;
  // Takes results that differ from what `d` would show: those of a step in another mjData, or the
  // program's. Not those of diverged worlds.
  void take_shown(mjData* d, int w, bool poses_only) const;
  // Writes what `call` shows.
  void show(const mjData* d, int w, RawCall call);
  // Writes NaN into all results.
  void show_diverged(int w) const;

  // Throws ValueError if a world has more constraints than its rows.
  void check_capacity() const;

 private:
  struct Field {
    DType type, dtype;  // of mjData, of the program
    int count;          // elements of a row
    bool constraints;   // there are nefc elements
    bool input, reset;  // written by the program; shown by a reset
    bool control;       // positions and velocities do not depend on it
    bool solved;        // of constraints: a result of the solver
    bool poses;         // of geoms, cameras or lights
    bool positions;     // follows from positions, without collisions
    const void* (*pointer)(const mjData*);
    std::byte* rows;
    std::size_t row_bytes;        // distance of two rows
    std::vector<std::byte> seen;  // [B, count], what was written last; of inputs

    bool is_in(RawCall call) const;
  };

  std::vector<Field> fields_;
  int max_constraints_ = std::numeric_limits<int>::max();
  std::vector<int> num_constraints_;  // by world
};

}  // namespace mjsense::worlds
