// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"
#include "mjsense/worlds/foreign_fields.h"

namespace mjsense::worlds {

ForeignModel::Own ForeignModel::own(const std::string& field) const {
  int size = 0, element = 0;
  const void* rows = mjb_expanded(worlds_.batch(), field.c_str(), &size, &element);
  return {static_cast<std::byte*>(const_cast<void*>(rows)),
          static_cast<std::size_t>(size) * element};
}

// Gives each world its own values. Null if MuJoCo cannot change them.
ForeignModel::Own ForeignModel::make_own(const std::string& field) {
  int size = 0, element = 0;
  void* rows = mjb_expand(worlds_.batch(), field.c_str(), &size, &element);
  return {static_cast<std::byte*>(rows), static_cast<std::size_t>(size) * element};
}

bool ForeignModel::add(const std::string& field, const ArrayView& rows) {
  const mjModel* m = worlds_.model();
  const std::optional<ModelFieldType> found = model_field(m, field);
  const auto count = static_cast<int>(rows.shape[1]),
             num_rows = std::min(static_cast<int>(rows.shape[0]), worlds_.size());
  if (!found || found->count != count || !converts(found->type, rows.dtype)) return false;
  Field added{.name = field,
              .type = found->type,
              .dtype = rows.dtype,
              .count = count,
              .num_rows = num_rows,
              .constants = set_const_use(field).in,
              .rows = rows.data,
              .row_bytes = static_cast<std::size_t>(rows.strides[0]),
              .seen = {}};
  const std::size_t bytes = added.bytes();
  added.seen.resize(bytes * num_rows);
  const Own values = own(field);
  for (int row = 0; row < num_rows; ++row) {
    const void* from = values.rows ? values.rows + values.bytes * row : model_values(*m, field);
    show_elements(from, found->type, added.seen.data() + row * bytes, rows.dtype, count);
  }
  if (values.rows) see_shared_rows(added, values);
  fields_.push_back(std::move(added));
  return true;
}

// Elements that differ between the worlds of a row are the program's from now on.
void ForeignModel::see_shared_rows(Field& f, Own values) const {
  const std::size_t bytes = f.bytes(), element = dtype_size(f.dtype);
  std::vector<std::byte> shown(bytes);
  for (int w = f.num_rows; w < worlds_.size(); ++w) {
    std::byte* seen = f.seen.data() + w % f.num_rows * bytes;
    const std::byte* now = f.rows + w % f.num_rows * f.row_bytes;
    show_elements(values.rows + values.bytes * w, f.type, shown.data(), f.dtype, f.count);
    for (std::size_t i = 0; i < bytes; i += element) {
      if (std::memcmp(&shown[i], seen + i, element) != 0)
        std::transform(now + i, now + i + element, seen + i, [](std::byte b) { return ~b; });
    }
  }
}

// Writes the values that the program has changed into the worlds' models, and checks them. Returns
// whether there are any. `derive`: the worlds in which MuJoCo derives others from them.
bool ForeignModel::write(std::vector<Written>& written, std::vector<int>& derive) {
  const int num_worlds = worlds_.size();
  std::vector<bool> changed(num_worlds, false), derives(num_worlds, false);
  for (const Field& f : fields_) {
    for (int row = 0; row < f.num_rows; ++row) {
      const std::byte *now = f.rows + row * f.row_bytes, *seen = f.seen.data() + row * f.bytes();
      if (std::memcmp(now, seen, f.bytes()) == 0) continue;
      const Own target = make_own(f.name);
      if (!target.rows)
        throw ValueError(fmt::format("{} cannot be changed after put_model()", f.name));
      for (int w = row; w < num_worlds; w += f.num_rows) {
        std::byte* place = target.rows + w * target.bytes;
        written.push_back({place, {place, place + target.bytes}});
        take_elements(now, seen, f.dtype, place, f.type, f.count);
        changed[w] = true;
        if (f.constants) derives[w] = true;
      }
    }
  }
  for (int w = 0; w < num_worlds; ++w) {
    if (!changed[w]) continue;
    for (auto& [names, worlds] : derived_) worlds[w] = 0;
    check_element_indices(worlds_.model_of(w));
  }
  for (int w = 0; w < num_worlds; ++w) {
    if (derives[w]) derive.push_back(w);
  }
  return !written.empty();
}

void ForeignModel::take() {
  std::vector<Written> written;
  std::vector<int> derived;
  try {
    if (!write(written, derived)) return;
    changed_();
    if (!derived.empty()) derive(derived, {});
  } catch (...) {
    for (const Written& one : written) std::ranges::copy(one.before, one.place);
    if (!derived.empty()) derive(derived, {});
    throw;
  }
  for (Field& f : fields_) {
    for (int row = 0; row < f.num_rows; ++row)
      std::memcpy(f.seen.data() + row * f.bytes(), f.rows + row * f.row_bytes, f.bytes());
  }
}

// Makes MuJoCo derive the values that the program's model does not have (bounding volumes, which frames
// are equal). Those that it has are its own, except those of `released`.
void ForeignModel::derive(const std::vector<int>& ids, std::span<const std::string> released) {
  mjBatch* batch = worlds_.batch();
  struct Kept {
    Own target;
    std::vector<std::byte> values;
  };
  std::vector<Kept> kept;
  for (const Field& f : fields_) {
    if (!set_const_use(f.name).out || std::ranges::count(released, f.name) > 0) continue;
    const Own target = make_own(f.name);
    if (!target.rows) continue;
    Kept& one = kept.emplace_back(Kept{target, std::vector<std::byte>(target.bytes * ids.size())});
    for (std::size_t i = 0; i < ids.size(); ++i)
      std::memcpy(one.values.data() + i * target.bytes, target.rows + ids[i] * target.bytes,
                  target.bytes);
  }
  const int failed = mjb_setConst(batch, ids.data(), static_cast<int>(ids.size()));
  for (const auto& [target, values] : kept) {
    for (std::size_t i = 0; i < ids.size(); ++i)
      std::memcpy(target.rows + ids[i] * target.bytes, values.data() + i * target.bytes,
                  target.bytes);
  }
  for (int w : failed ? ids : std::vector<int>{}) {
    if (*mjb_error(batch, w))
      throw ValueError(
          fmt::format("MuJoCo cannot use the model of world {}: {}", w, mjb_error(batch, w)));
  }
}

void ForeignModel::set_constants(std::span<const std::string> names) {
  take();
  std::vector<std::uint8_t>& derived = derived_[{names.begin(), names.end()}];
  derived.resize(worlds_.size());
  std::vector<int> ids;
  for (int w = 0; w < worlds_.size(); ++w)
    if (!derived[w]) ids.push_back(w);
  if (ids.empty()) return;
  const auto is_named = [&](const Field& f) { return std::ranges::count(names, f.name) > 0; };
  // MuJoCo writes the values of each world where it has its own.
  for (const Field& f : fields_)
    if (f.num_rows > 1 && is_named(f)) make_own(f.name);
  derive(ids, names);
  changed_();
  for (Field& f : fields_)
    if (is_named(f)) show(f);
  derived.assign(worlds_.size(), 1);
}

// Writes the worlds' values of a field into the rows of its array. Worlds that share a row have its values.
void ForeignModel::show(Field& f) const {
  const Own values = own(f.name);
  for (int row = 0; row < f.num_rows; ++row) {
    std::byte* first = values.rows ? values.rows + values.bytes * row : nullptr;
    std::byte* seen = f.seen.data() + row * f.bytes();
    show_elements(first ? first : model_values(*worlds_.model(), f.name), f.type, seen, f.dtype,
                  f.count);
    std::memcpy(f.rows + row * f.row_bytes, seen, f.bytes());
    for (int w = row + f.num_rows; first && w < worlds_.size(); w += f.num_rows)
      std::memcpy(values.rows + values.bytes * w, first, values.bytes);
  }
}

}  // namespace mjsense::worlds
