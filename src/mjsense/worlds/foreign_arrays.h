// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays of another program, with a row for each world, that show the worlds and that the program
// writes: the fields of mujoco_warp's Data and Model on the CPU.
//
// The arrays are float32, the worlds are float64. An element of the state is taken from the program
// only if it differs from the float32 number that was written there last, so that states keep double
// precision unless the program writes them. The same holds for the model.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/worlds/scratch_data.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

// MuJoCo's function that is called for each world. kPositions: those that compute what follows from
// positions, without collisions.
enum class RawCall { kStep, kForward, kStep1, kStep2, kReset, kPositions };

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
  struct Field {
    DType type, dtype;  // of mjData, of the program
    int count;          // elements of a row
    bool constraints;   // there are nefc elements
    bool input, reset;  // written by the program; shown by a reset
    bool control;       // positions and velocities do not depend on it
    bool contact_ids;   // of contacts among those of all worlds
    bool solved;        // of constraints: a result of the solver
    bool poses;         // of geoms, cameras or lights
    bool positions;     // follows from positions, without collisions
    const void* (*pointer)(const mjData*);
    std::byte* rows;
    std::size_t row_bytes;        // distance of two rows
    std::vector<std::byte> seen;  // [B, count], what was written last; of inputs
  };
  struct ModelField {
    std::string name;
    DType type, dtype;
    int count, num_rows;  // at most one for each world
    bool constants;       // MuJoCo derives others from it
    const std::byte* rows;
    std::size_t row_bytes;
    std::vector<std::byte> seen;  // [num_rows, count]
  };
  struct ContactField {
    int made;            // which of the fields that mjContact does not have; -1: one that it has
    std::size_t offset;  // in mjContact
    DType dtype;
    int count;
    std::byte* rows;
    std::size_t row_bytes;
  };

  static void run_world(const mjModel* m, mjData* d, int w, void* argument);
  bool take(mjData* d, int w);
  void take_shown(mjData* d, int w, bool poses_only) const;
  void step_in_scratch(const mjModel* m, mjData* d, int w);
  void compute_positions(const mjModel* m, mjData* d, int w);
  void show_model(ModelField& field);
  void show(const mjData* d, int w);
  void show_diverged(const mjModel* m, mjData* d, int w);
  void show_contacts(const mjModel* m, int w);
  void number_contacts();
  void fill_scratch();
  struct Written {
    std::byte* place;
    std::vector<std::byte> before;
  };
  void take_model();
  bool write_model(std::vector<Written>& written, std::vector<int>& derive);
  void derive(const std::vector<int>& ids, std::span<const std::string> released);
  void apply(mjfBatchFunc function);
  void check_capacity() const;

  Worlds worlds_;
  std::vector<Field> fields_;
  std::vector<ModelField> model_fields_;
  std::vector<ContactField> contact_fields_;
  // Of the program's data, and rows of the arrays.
  int max_contacts_ = std::numeric_limits<int>::max();
  int max_constraints_ = std::numeric_limits<int>::max();
  // By world: its contacts, the number of its constraints, the first of them of a contact, the row of
  // its first contact in the arrays, and that row when efc_id was written.
  std::vector<std::vector<mjContact>> contacts_;
  std::vector<int> num_constraints_, first_contact_row_, first_contact_, written_first_contact_;
  ScratchData scratch_;
  std::vector<mjData*> borrowed_;  // by world; not null after a MuJoCo error
  // By world: positions and velocities are those of the state, so that a step need not compute them.
  std::vector<std::uint8_t> current_;
  // By the fields of set_constants(), by world: it has derived them since the model changed.
  std::map<std::vector<std::string>, std::vector<std::uint8_t>> derived_;
  std::vector<std::uint8_t> scratched_;  // by world: its mjData has only the state of the last step
  RawCall call_ = RawCall::kStep;
  const bool* mask_ = nullptr;
};

}  // namespace mjsense::worlds
