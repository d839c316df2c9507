// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays of another program that show the contacts of all worlds, one after the other: mujoco_warp's
// contacts.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"

namespace mjsense::worlds {

class ForeignContacts {
 public:
  explicit ForeignContacts(int num_worlds) : worlds_(num_worlds) {}

  // Forgets all arrays. There are at most this many contacts of all worlds.
  void clear(int max_contacts);
  // ForeignArrays::add_contacts().
  bool add(std::string_view field, const ArrayView& rows);
  // `rows` [B, n] is efc_id. The caller writes the numbers of contacts in their world; show() adds the
  // row of the world's first contact.
  void add_ids(const ArrayView& rows);

  // Copies the contacts of a world after MuJoCo's call.
  void copy(const mjData* d, int w);
  // Gives the contacts of all worlds their rows, and writes their number. Returns whether show() must
  // be called for each world.
  bool assign_rows();
  void show(const mjModel* m, int w);

  // Throws ValueError if there are more contacts than rows.
  void check_capacity() const;

 private:
  // Fields that mjContact does not have in this form.
  enum class Made { kWorld, kType, kNumber, kAddresses, kCount };
  static std::optional<Made> made(std::string_view field);

  struct Field {
    std::optional<Made> made;  // otherwise it is at `offset` of mjContact
    std::size_t offset;
    DType dtype;
    int count;
    std::byte* rows;
    std::size_t row_bytes;
  };
  struct PerWorld {
    std::vector<mjContact> contacts;
    int begin_constraints = 0, end_constraints = 0;  // rows of contacts in the constraints
    int first = 0;                                   // row of its first contact in the arrays
    int id_offset = 0;                               // that show() has added to efc_id
  };
  struct Ids {
    std::byte* rows;
    std::size_t row_bytes;
    int count;
  };
  void show_field(const Field& field, const mjModel* m, int w, int count) const;

  std::vector<Field> fields_;
  std::vector<Ids> ids_;
  std::vector<PerWorld> worlds_;
  int max_contacts_ = std::numeric_limits<int>::max();
};

}  // namespace mjsense::worlds
