// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays of another program, with a row for each world, that show the worlds and that the program
// writes: the fields of mujoco_warp's Data and Model on the CPU.
//
// The arrays are float32, the worlds are float64. An element of the state is taken from the program
// only if it differs from the float32 number that was written there last, so that states keep double
// precision unless the program writes them. The same holds for the model.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/worlds/foreign_contacts.h"
#include "mjsense/worlds/foreign_data.h"
#include "mjsense/worlds/foreign_model.h"
#include "mjsense/worlds/scratch_data.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

class ForeignArrays {
 public:
  // MuJoCo does not reset diverged worlds: the program sees their NaN.
  ForeignArrays(const mjModel* model, int num_worlds, int threads);

  Worlds& worlds() { return worlds_; }
  // Forgets all arrays. The program's data has room for this many contacts of all worlds, and rows of
  // constraints of each.
  void clear(int max_contacts, int max_constraints);
  // World w gets values[w % size] of an option with one number, opt.impratio. opt.disableflags always
  // includes mjDSBL_AUTORESET.
  void set_option(const std::string& name, const std::vector<double>& values);

  // `rows` [B, n] shows this field of mjData; `input`: the program may also write it. Of the fields
  // efc_... a world fills as many elements as it has constraints, and efc_id has the row of a contact
  // among those of all worlds. Returns false if MuJoCo has no such field, or one of another size or
  // type.
  bool add_data(std::string_view field, const ArrayView& rows, bool input);
  // Row w % R of `rows` [R, n] has the values of this field of the model, or option (opt.gravity), for
  // world w. Returns false as above.
  bool add_model(const std::string& field, const ArrayView& rows);
  // `rows` [capacity, n] shows this field of mjContact, a row for each contact of all worlds in their
  // order. Also worldid; type (1: a contact of the physics); geomcollisionid (number of the contact
  // among those of its two geoms); efc_address, with -1 after the contact's own rows; and count [1, 1].
  // Returns false as above.
  bool add_contacts(std::string_view field, const ArrayView& rows);

  // Takes what the program has written, calls MuJoCo's function, and writes the results. A reset is
  // for the worlds of `mask` [B], by default all, and shows only the state, accelerations and MuJoCo's
  // sensors, as mujoco_warp's does. mj_step2 after a step without mj_step1 calls mj_step1 first. Throws
  // ValueError if the worlds cannot have the model's values, or if there are more contacts or
  // constraints than rows for them; the arrays then show the state after the call all the same. Throws
  // RuntimeError if MuJoCo raises an error in a world.
  void run(RawCall call, const bool* mask = nullptr);

  // Derives values of the model from others with mj_setConst, and writes those of `fields` into their
  // arrays; all others are kept. `restore`: also writes what depends on positions, for the states and the
  // new model. Row r of an array is that of world r.
  void set_constants(std::span<const std::string> fields, bool restore);

  // Takes the model and the poses of geoms, cameras and lights that the program has written or that a
  // reset has left, for rays and images.
  void take_poses();

 private:
  static void run_world(const mjModel* m, mjData* d, int w, void* argument);
  void step_in_scratch(const mjModel* m, mjData* d, int w);
  void compute_positions(const mjModel* m, mjData* d, int w);
  void show(const mjData* d, int w);
  void show_diverged(const mjModel* m, mjData* d, int w);
  void fill_scratch();
  void apply(mjfBatchFunc function);

  Worlds worlds_;
  ForeignData data_;
  ForeignModel model_;
  ForeignContacts contacts_;
  ScratchData scratch_;
  std::vector<mjData*> borrowed_;  // by world; not null after a MuJoCo error
  // By world: positions and velocities are those of the state, so that a step need not compute them.
  std::vector<std::uint8_t> current_;
  std::vector<std::uint8_t> scratched_;  // by world: its mjData has only the state of the last step
  RawCall call_ = RawCall::kStep;
  const bool* mask_ = nullptr;
};

}  // namespace mjsense::worlds
