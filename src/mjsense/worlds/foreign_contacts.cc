// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_contacts.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "mjsense/core/error.h"
#include "mjsense/worlds/foreign_fields.h"

namespace mjsense::worlds {
namespace {

struct ContactPlace {
  std::string_view name;
  std::size_t offset;
  DType dtype;  // of the array
  int count;
};
#define PLACE(name, dtype, count) \
  { #name, offsetof(mjContact, name), DType::dtype, count }
constexpr ContactPlace kContactPlaces[] = {
    PLACE(dist, kFloat32, 1),        PLACE(pos, kFloat32, 3),
    PLACE(frame, kFloat32, 9),       PLACE(includemargin, kFloat32, 1),
    PLACE(friction, kFloat32, 5),    PLACE(solref, kFloat32, mjNREF),
    PLACE(solimp, kFloat32, mjNIMP), PLACE(solreffriction, kFloat32, mjNREF),
    PLACE(adhesion, kFloat32, 1),    PLACE(surfacevel, kFloat32, 3),
    PLACE(dim, kInt32, 1),           PLACE(geom, kInt32, 2),
    PLACE(flex, kInt32, 2),          PLACE(elem, kInt32, 2),
    PLACE(vert, kInt32, 2)};
#undef PLACE

// The number of rows that a contact has in the constraints.
int constraint_rows(const mjModel* m, const mjContact& contact) {
  if (contact.efc_address < 0) return 0;
  if (contact.dim == 1 || m->opt.cone == mjCONE_ELLIPTIC) return contact.dim;
  return 2 * (contact.dim - 1);
}

}  // namespace

std::optional<ForeignContacts::Made> ForeignContacts::made(std::string_view field) {
  constexpr std::string_view kNames[] = {"worldid", "type", "geomcollisionid", "efc_address",
                                         "count"};
  const auto* found = std::ranges::find(kNames, field);
  if (found == std::end(kNames)) return {};
  return static_cast<Made>(found - kNames);
}

void ForeignContacts::clear(int max_contacts) {
  fields_.clear();
  ids_.clear();
  max_contacts_ = max_contacts;
}

bool ForeignContacts::add(std::string_view field, const ArrayView& rows) {
  const auto count = static_cast<int>(rows.shape[1]), capacity = static_cast<int>(rows.shape[0]);
  Field added{made(field), 0,         DType::kInt32,
              1,           rows.data, static_cast<std::size_t>(rows.strides[0])};
  if (added.made == Made::kAddresses) {
    added.count = count;
  } else if (!added.made) {
    const auto* place = std::ranges::find(kContactPlaces, field, &ContactPlace::name);
    if (place == std::end(kContactPlaces)) return false;
    added.offset = place->offset;
    added.dtype = place->dtype;
    added.count = place->count;
  }
  if (rows.dtype != added.dtype || count != added.count) return false;
  if (added.made != Made::kCount) max_contacts_ = std::min(max_contacts_, capacity);
  fields_.push_back(added);
  return true;
}

void ForeignContacts::add_ids(const ArrayView& rows) {
  ids_.push_back(
      {rows.data, static_cast<std::size_t>(rows.strides[0]), static_cast<int>(rows.shape[1])});
}

void ForeignContacts::copy(const mjData* d, int w) {
  PerWorld& world = worlds_[w];
  world.contacts.assign(d->contact, d->contact + d->ncon);
  world.begin_constraints = d->ne + d->nf + d->nl;
  world.end_constraints = d->nefc;
  world.id_offset = 0;
}

bool ForeignContacts::assign_rows() {
  int contacts = 0;
  for (PerWorld& world : worlds_) {
    world.first = contacts;
    contacts += static_cast<int>(world.contacts.size());
  }
  for (const Field& f : fields_) {
    if (f.made == Made::kCount) *reinterpret_cast<int*>(f.rows) = std::min(contacts, max_contacts_);
  }
  return contacts > 0 && !fields_.empty();
}

void ForeignContacts::show(const mjModel* m, int w) {
  PerWorld& world = worlds_[w];
  for (const Ids& of : ids_) {
    auto* ids = reinterpret_cast<int*>(of.rows + w * of.row_bytes);
    for (int i = world.begin_constraints; i < std::min(of.count, world.end_constraints); ++i)
      ids[i] += world.first - world.id_offset;
  }
  world.id_offset = world.first;
  const int room =
      std::clamp(max_contacts_ - world.first, 0, static_cast<int>(world.contacts.size()));
  for (const Field& f : fields_) show_field(f, m, w, room);
}

void ForeignContacts::show_field(const Field& f, const mjModel* m, int w, int count) const {
  if (f.made == Made::kCount) return;
  const PerWorld& world = worlds_[w];
  std::byte* row = f.rows + world.first * f.row_bytes;
  int number = 0;
  for (int i = 0; i < count; ++i, row += f.row_bytes) {
    const mjContact& contact = world.contacts[i];
    auto* ids = reinterpret_cast<int*>(row);
    if (!f.made) {
      const void* from = reinterpret_cast<const std::byte*>(&contact) + f.offset;
      show_elements(from, f.dtype == DType::kFloat32 ? DType::kFloat64 : DType::kInt32, row,
                    f.dtype, f.count);
    } else if (f.made == Made::kWorld) {
      *ids = w;
    } else if (f.made == Made::kType) {
      *ids = 1;
    } else if (f.made == Made::kNumber) {
      const bool same = i > 0 && std::equal(contact.geom, contact.geom + 2, (&contact)[-1].geom);
      number = same ? number + 1 : 0;
      *ids = number;
    } else {
      const int rows = constraint_rows(m, contact);
      for (int k = 0; k < f.count; ++k) ids[k] = k < rows ? contact.efc_address + k : -1;
    }
  }
}

void ForeignContacts::check_capacity() const {
  const auto num_worlds = static_cast<int>(worlds_.size());
  const int contacts = worlds_.back().first + static_cast<int>(worlds_.back().contacts.size());
  if (contacts > max_contacts_)
    throw ValueError(fmt::format(
        "the {} worlds have {} contacts, and the data has room for {}: make it with "
        "nconmax={} or more",
        num_worlds, contacts, max_contacts_, (2 * contacts + num_worlds - 1) / num_worlds));
}

}  // namespace mjsense::worlds
