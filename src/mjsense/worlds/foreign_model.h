// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays of another program that have the values of the worlds' models: the fields of mujoco_warp's
// Model.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

class ForeignModel {
 public:
  // `changed` is called when the models of worlds have other values.
  ForeignModel(Worlds& worlds, std::function<void()> changed)
      : worlds_(worlds), changed_(std::move(changed)) {}

  void clear() { fields_.clear(); }
  // ForeignArrays::add_model().
  bool add(const std::string& field, const ArrayView& rows);
  // Takes the program's values. Throws ValueError if the worlds cannot have one; they then keep theirs.
  void take();
  // ForeignArrays::set_constants().
  void set_constants(std::span<const std::string> names);

 private:
  struct Field {
    std::string name;
    DType type, dtype;    // of mjModel, of the program
    int count, num_rows;  // at most one row for each world
    bool constants;       // MuJoCo derives others from it
    std::byte* rows;
    std::size_t row_bytes;
    std::vector<std::byte> seen;  // [num_rows, count]

    std::size_t bytes() const { return count * dtype_size(dtype); }
  };
  struct Written {
    std::byte* place;
    std::vector<std::byte> before;
  };
  // The values of one field in the models of all worlds; null if they share the first model's.
  struct Own {
    std::byte* rows;
    std::size_t bytes;  // of a world
  };

  Own own(const std::string& field) const;
  Own make_own(const std::string& field);
  void see_shared_rows(Field& field, Own own) const;
  bool write(std::vector<Written>& written, std::vector<int>& derive);
  void derive(const std::vector<int>& ids, std::span<const std::string> released);
  void show(Field& field) const;

  Worlds& worlds_;
  std::function<void()> changed_;
  std::vector<Field> fields_;
  // By the names of set_constants(), by world: it has derived them since the model changed.
  std::map<std::vector<std::string>, std::vector<std::uint8_t>> derived_;
};

}  // namespace mjsense::worlds
