// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <limits>
#include <optional>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/worlds/foreign_fields.h"
#include "mjsense/worlds/ordered_apply.h"
#include "mjsense/worlds/step_stages.h"

namespace mjsense::worlds {
namespace {

constexpr std::string_view kControls[] = {"ctrl", "qfrc_applied", "xfrc_applied", "qacc_warmstart"};
// Fields that a reset shows in addition to the state.
constexpr std::string_view kReset[] = {"qacc", "act_dot", "sensordata", "energy",
                                       "ne",   "nf",      "nl",         "nefc"};
// Fields of constraints that mj_step1 does not compute.
constexpr std::string_view kSolved[] = {"efc_state", "efc_force"};
// Fields that kPositions shows.
constexpr std::string_view kPositions[] = {"xpos",
                                           "xquat",
                                           "xmat",
                                           "xipos",
                                           "ximat",
                                           "xanchor",
                                           "xaxis",
                                           "geom_xpos",
                                           "geom_xmat",
                                           "site_xpos",
                                           "site_xmat",
                                           "cam_xpos",
                                           "cam_xmat",
                                           "light_xpos",
                                           "light_xdir",
                                           "subtree_com",
                                           "cdof",
                                           "cinert",
                                           "flexvert_xpos",
                                           "flexedge_J",
                                           "flexedge_length",
                                           "ten_wrapadr",
                                           "ten_wrapnum",
                                           "ten_J",
                                           "ten_length",
                                           "wrap_obj",
                                           "wrap_xpos",
                                           "actuator_length",
                                           "moment_rownnz",
                                           "moment_rowadr",
                                           "moment_colind",
                                           "actuator_moment",
                                           "crb",
                                           "M"};
constexpr std::string_view kPoses[] = {"geom_xpos", "geom_xmat",  "cam_xpos",
                                       "cam_xmat",  "light_xpos", "light_xdir"};

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
// Fields that mjContact does not have in this form.
enum Made { kNotMade = -1, kWorld, kType, kNumber, kAddresses, kCount };
constexpr std::string_view kMade[] = {"worldid", "type", "geomcollisionid", "efc_address", "count"};

// The number of rows that a contact has in the constraints.
int constraint_rows(const mjModel* m, const mjContact& contact) {
  if (contact.efc_address < 0) return 0;
  if (contact.dim == 1 || m->opt.cone == mjCONE_ELLIPTIC) return contact.dim;
  return 2 * (contact.dim - 1);
}

}  // namespace

ForeignArrays::ForeignArrays(const mjModel* model, int num_worlds, int threads)
    : worlds_(model, num_worlds, threads),
      contacts_(num_worlds),
      num_constraints_(num_worlds),
      first_contact_row_(num_worlds),
      first_contact_(num_worlds),
      written_first_contact_(num_worlds),
      scratch_(worlds_.model()),
      borrowed_(num_worlds),
      current_(num_worlds),
      scratched_(num_worlds) {
  fill_scratch();
  set_option("opt.disableflags", {static_cast<double>(model->opt.disableflags)});
}

void ForeignArrays::set_option(const std::string& name, const std::vector<double>& values) {
  int size = 0, element = 0;
  current_.assign(worlds_.size(), 0);
  void* rows = mjb_expand(worlds_.batch(), name.c_str(), &size, &element);
  if (!rows || size != 1 || values.empty())
    throw ValueError(fmt::format("MuJoCo has no option {} with one number", name));
  for (int w = 0; w < worlds_.size(); ++w) {
    const double value = values[w % values.size()];
    if (element == sizeof(int))
      static_cast<int*>(rows)[w] =
          static_cast<int>(value) | (name == "opt.disableflags" ? mjDSBL_AUTORESET : 0);
    else
      static_cast<mjtNum*>(rows)[w] = value;
  }
}

void ForeignArrays::clear(int max_contacts, int max_constraints) {
  fields_.clear();
  model_fields_.clear();
  contact_fields_.clear();
  max_contacts_ = max_contacts;
  max_constraints_ = max_constraints;
}

// Makes an mjData for each thread, so that none is made while the worlds run.
void ForeignArrays::fill_scratch() {
  std::vector<ScratchData::Loan> all(worlds_.threads());
  for (ScratchData::Loan& one : all) one = scratch_.borrow();
}

// Calls function(m, d, world, this) for all worlds.
void ForeignArrays::apply(mjfBatchFunc function) {
  apply_ordered(worlds_.batch(), nullptr, 0, function, this, 1);
  scene::drop_warnings(false);  // an error leaves the flag set
  for (mjData*& data : borrowed_) {
    if (!data) continue;
    mj_deleteData(std::exchange(data, nullptr));
    fill_scratch();
  }
  for (int w = 0; w < worlds_.size(); ++w) {
    if (mjb_status(worlds_.batch())[w])
      throw RuntimeError(fmt::format("world {}: MuJoCo: {}", w, mjb_error(worlds_.batch(), w)));
  }
}

bool ForeignArrays::add_data(std::string_view field, const ArrayView& rows, bool input) {
  const std::optional<DataField> found = data_field(worlds_.model(), field);
  const auto count = static_cast<int>(rows.shape[1]);
  if (!found || !converts(found->type, rows.dtype) ||
      (!found->constraints && found->count != count))
    return false;
  fields_.push_back({.type = found->type,
                     .dtype = rows.dtype,
                     .count = count,
                     .constraints = found->constraints,
                     .input = input,
                     .reset = input || std::ranges::count(kReset, field) > 0,
                     .control = std::ranges::count(kControls, field) > 0,
                     .contact_ids = field == "efc_id",
                     .solved = std::ranges::count(kSolved, field) > 0,
                     .poses = std::ranges::count(kPoses, field) > 0,
                     .positions = std::ranges::count(kPositions, field) > 0,
                     .pointer = found->pointer,
                     .rows = rows.data,
                     .row_bytes = static_cast<std::size_t>(rows.strides[0]),
                     .seen = {}});
  if (found->constraints) max_constraints_ = std::min(max_constraints_, count);
  Field& added = fields_.back();
  if (!input) return true;
  // The worlds have the model's initial state; the arrays may differ.
  const std::size_t bytes = count * dtype_size(rows.dtype);
  added.seen.resize(bytes * worlds_.size());
  apply([](const mjModel*, mjData* d, int w, void* argument) {
    Field& f = static_cast<ForeignArrays*>(argument)->fields_.back();
    const std::size_t bytes = f.count * dtype_size(f.dtype);
    show_elements(f.pointer(d), f.type, f.seen.data() + w * bytes, f.dtype, f.count);
  });
  return true;
}

bool ForeignArrays::add_model(const std::string& field, const ArrayView& rows) {
  const mjModel* m = worlds_.model();
  const std::optional<ModelFieldType> found = model_field(m, field);
  const auto count = static_cast<int>(rows.shape[1]),
             num_rows = std::min(static_cast<int>(rows.shape[0]), worlds_.size());
  if (!found || found->count != count || !converts(found->type, rows.dtype)) return false;
  ModelField added{.name = field,
                   .type = found->type,
                   .dtype = rows.dtype,
                   .count = count,
                   .num_rows = num_rows,
                   .constants = set_const_use(field).in,
                   .rows = rows.data,
                   .row_bytes = static_cast<std::size_t>(rows.strides[0]),
                   .seen = {}};
  const std::size_t element = dtype_size(rows.dtype), bytes = count * element;
  added.seen.resize(bytes * num_rows);
  std::vector<std::byte> shown(bytes);
  int own_count = 0, own_element = 0;
  const auto* own = static_cast<const std::byte*>(
      mjb_expanded(worlds_.batch(), field.c_str(), &own_count, &own_element));
  const std::size_t own_bytes = static_cast<std::size_t>(own_count) * own_element;
  for (int w = 0; w < (own ? worlds_.size() : num_rows); ++w) {
    const void* values = own ? own + own_bytes * w : model_values(*m, field);
    std::byte* seen = added.seen.data() + w % num_rows * bytes;
    if (w < num_rows) {
      show_elements(values, found->type, seen, rows.dtype, count);
      continue;
    }
    // Elements that differ between the worlds of a row are the program's from now on.
    const std::byte* now = added.rows + w % num_rows * added.row_bytes;
    show_elements(values, found->type, shown.data(), rows.dtype, count);
    for (std::size_t i = 0; i < bytes; i += element) {
      if (std::memcmp(&shown[i], seen + i, element) != 0)
        std::transform(now + i, now + i + element, seen + i, [](std::byte b) { return ~b; });
    }
  }
  model_fields_.push_back(std::move(added));
  return true;
}

bool ForeignArrays::add_contacts(std::string_view field, const ArrayView& rows) {
  const auto count = static_cast<int>(rows.shape[1]), capacity = static_cast<int>(rows.shape[0]);
  const auto add = [&](int made, std::size_t offset, DType dtype, int expected) {
    if (rows.dtype != dtype || (expected > 0 && count != expected)) return false;
    if (made != kCount) max_contacts_ = std::min(max_contacts_, capacity);
    contact_fields_.push_back(
        {made, offset, dtype, count, rows.data, static_cast<std::size_t>(rows.strides[0])});
    return true;
  };
  for (const ContactPlace& place : kContactPlaces) {
    if (place.name == field) return add(kNotMade, place.offset, place.dtype, place.count);
  }
  const auto* made = std::ranges::find(kMade, field);
  if (made == std::end(kMade)) return false;
  const auto kind = static_cast<int>(made - kMade);
  return add(kind, 0, DType::kInt32, kind == kAddresses ? 0 : 1);
}

// Returns whether anything was written on which positions and velocities depend.
bool ForeignArrays::take(mjData* d, int w) {
  bool moved = false;
  for (const Field& f : fields_) {
    if (!f.input) continue;
    const std::size_t bytes = f.count * dtype_size(f.dtype);
    const std::byte *now = f.rows + w * f.row_bytes, *seen = f.seen.data() + w * bytes;
    if (std::memcmp(now, seen, bytes) == 0) continue;
    take_elements(now, seen, f.dtype, const_cast<void*>(f.pointer(d)), f.type, f.count);
    if (!f.control) moved = true;
  }
  return moved;
}

// Takes results that differ from what `d` would show: those of a step in another mjData, or the
// program's. Not those of diverged worlds.
void ForeignArrays::take_shown(mjData* d, int w, bool poses_only) const {
  for (const Field& f : fields_) {
    if (f.input || f.constraints || f.type != DType::kFloat64 || (poses_only && !f.poses)) continue;
    const auto* row = reinterpret_cast<const float*>(f.rows + w * f.row_bytes);
    auto* to = static_cast<mjtNum*>(const_cast<void*>(f.pointer(d)));
    for (int i = 0; i < f.count; ++i) {
      if (std::isfinite(row[i]) && static_cast<float>(to[i]) != row[i]) to[i] = row[i];
    }
  }
}

void ForeignArrays::take_poses() {
  take_model();
  apply([](const mjModel*, mjData* d, int w, void* argument) {
    static_cast<const ForeignArrays*>(argument)->take_shown(d, w, true);
  });
}

void ForeignArrays::show(const mjData* d, int w) {
  for (Field& f : fields_) {
    if (call_ == RawCall::kReset && !f.reset) continue;
    if (call_ == RawCall::kStep1 && f.solved) continue;
    if (call_ == RawCall::kPositions && !f.positions) continue;
    const std::int64_t n = f.constraints ? std::min(f.count, d->nefc) : f.count;
    std::byte* row = f.rows + w * f.row_bytes;
    show_elements(f.pointer(d), f.type, row, f.dtype, n);
    if (f.input)
      std::memcpy(f.seen.data() + w * n * dtype_size(f.dtype), row, n * dtype_size(f.dtype));
  }
  if (call_ == RawCall::kPositions) return;
  contacts_[w].assign(d->contact, d->contact + d->ncon);
  written_first_contact_[w] = 0;
  num_constraints_[w] = d->nefc;
  first_contact_row_[w] = d->ne + d->nf + d->nl;
}

void ForeignArrays::show_contacts(const mjModel* m, int w) {
  for (const Field& f : fields_) {
    if (!f.contact_ids) continue;
    auto* ids = reinterpret_cast<int*>(f.rows + w * f.row_bytes);
    for (int i = first_contact_row_[w]; i < std::min(f.count, num_constraints_[w]); ++i)
      ids[i] += first_contact_[w] - written_first_contact_[w];
  }
  written_first_contact_[w] = first_contact_[w];
  const std::vector<mjContact>& contacts = contacts_[w];
  const int room =
      std::clamp(max_contacts_ - first_contact_[w], 0, static_cast<int>(contacts.size()));
  for (const ContactField& f : contact_fields_) {
    if (f.made == kCount) continue;
    std::byte* row = f.rows + first_contact_[w] * f.row_bytes;
    int number = 0;
    for (int i = 0; i < room; ++i, row += f.row_bytes) {
      const mjContact& contact = contacts[i];
      auto* ids = reinterpret_cast<int*>(row);
      if (f.made == kNotMade) {
        const void* from = reinterpret_cast<const std::byte*>(&contact) + f.offset;
        show_elements(from, f.dtype == DType::kFloat32 ? DType::kFloat64 : DType::kInt32, row,
                      f.dtype, f.count);
      } else if (f.made == kWorld) {
        *ids = w;
      } else if (f.made == kType) {
        *ids = 1;
      } else if (f.made == kNumber) {
        const bool same = i > 0 && std::equal(contact.geom, contact.geom + 2, (&contact)[-1].geom);
        number = same ? number + 1 : 0;
        *ids = number;
      } else {
        const int rows = constraint_rows(m, contact);
        for (int k = 0; k < f.count; ++k) ids[k] = k < rows ? contact.efc_address + k : -1;
      }
    }
  }
}

// Uses an mjData that is shared by the thread's worlds and stays in its cache, as
// Worlds::step_in_scratch(). Poses that rays read are carried over, too.
void ForeignArrays::step_in_scratch(const mjModel* m, mjData* d, int w) {
  mjData* s = borrowed_[w] = scratch_.borrow().release();
  mj_copyState(m, d, s, mjSTATE_INTEGRATION);
  mj_step(m, s);
  mj_copyState(m, s, d, mjSTATE_INTEGRATION);
  mju_copy(d->geom_xpos, s->geom_xpos, 3 * static_cast<int>(m->ngeom));
  mju_copy(d->geom_xmat, s->geom_xmat, 9 * static_cast<int>(m->ngeom));
  show(s, w);
  scratched_[w] = 1;
  borrowed_[w] = nullptr;
  const ScratchData::Loan returned(s, ScratchData::Release{&scratch_});
  scene::drop_warnings(false);
  orders_before(this);
}

// Computes them in another mjData, which has the world's state only. Poses that rays read are carried
// over by take_poses().
void ForeignArrays::compute_positions(const mjModel* m, mjData* d, int w) {
  mjData* s = borrowed_[w] = scratch_.borrow().release();
  mj_copyState(m, d, s, mjSTATE_INTEGRATION);
  mj_fwdKinematics(m, s);
  mj_makeM(m, s);
  mj_factorM(m, s);
  mj_transmission(m, s);
  show(s, w);
  borrowed_[w] = nullptr;
  const ScratchData::Loan returned(s, ScratchData::Release{&scratch_});
}

// A world whose state is not finite: MuJoCo would find contacts between all its geoms. Its state stays,
// and its results are NaN.
void ForeignArrays::show_diverged(const mjModel* m, mjData* d, int w) {
  d->ncon = d->ne = d->nf = d->nl = d->nefc = 0;
  if (call_ == RawCall::kStep || call_ == RawCall::kStep2) d->time += m->opt.timestep;
  show(d, w);
  for (const Field& f : fields_) {
    auto* row = reinterpret_cast<float*>(f.rows + w * f.row_bytes);
    if (f.dtype == DType::kFloat32 && !f.input)
      std::fill_n(row, f.count, std::numeric_limits<float>::quiet_NaN());
  }
}

void ForeignArrays::run_world(const mjModel* m, mjData* d, int w, void* argument) {
  ordered_after(argument);
  auto& self = *static_cast<ForeignArrays*>(argument);
  if (self.call_ == RawCall::kReset && self.mask_ && !self.mask_[w]) return;
  scene::drop_warnings(true);
  const bool current = !self.take(d, w) && self.current_[w];
  self.current_[w] = 0;  // also if a MuJoCo error jumps out of this function
  const auto is_bad = [](mjtNum x) { return mju_isBad(x) != 0; };
  if (self.call_ != RawCall::kReset && (std::any_of(d->qpos, d->qpos + m->nq, is_bad) ||
                                        std::any_of(d->qvel, d->qvel + m->nv, is_bad))) {
    self.show_diverged(m, d, w);
    scene::drop_warnings(false);
    return orders_before(argument);
  }
  switch (self.call_) {
    case RawCall::kStep:
      if (!can_split_step(m)) {
        mj_step(m, d);
      } else if (current) {
        step_from(mjSTAGE_VEL, m, d, true);
      } else {
        return self.step_in_scratch(m, d, w);
      }
      break;
    case RawCall::kForward:
      mj_forward(m, d);
      break;
    case RawCall::kStep1:
      self.take_shown(d, w, false);
      mj_step1(m, d);
      break;
    case RawCall::kStep2:
      if (self.scratched_[w]) mj_step1(m, d);
      mj_step2(m, d);
      break;
    case RawCall::kReset:
      mj_resetData(m, d);
      break;
    case RawCall::kPositions:
      self.compute_positions(m, d, w);
      scene::drop_warnings(false);
      return orders_before(argument);
  }
  self.scratched_[w] = 0;
  self.current_[w] = self.call_ == RawCall::kForward || self.call_ == RawCall::kStep1;
  self.show(d, w);
  scene::drop_warnings(false);
  orders_before(argument);
}

// Writes the values of the model that the program has changed into the worlds' models, and checks
// them. Returns whether there are any. `derive`: the worlds in which MuJoCo derives others from them.
bool ForeignArrays::write_model(std::vector<Written>& written, std::vector<int>& derive) {
  const int num_worlds = worlds_.size();
  std::vector<bool> changed(num_worlds, false), derives(num_worlds, false);
  for (const ModelField& f : model_fields_) {
    const std::size_t bytes = f.count * dtype_size(f.dtype);
    for (int row = 0; row < f.num_rows; ++row) {
      const std::byte *now = f.rows + row * f.row_bytes, *seen = f.seen.data() + row * bytes;
      if (std::memcmp(now, seen, bytes) == 0) continue;
      int size = 0, element = 0;
      auto* target =
          static_cast<std::byte*>(mjb_expand(worlds_.batch(), f.name.c_str(), &size, &element));
      if (!target) throw ValueError(fmt::format("{} cannot be changed after put_model()", f.name));
      const std::size_t world_bytes = static_cast<std::size_t>(size) * element;
      for (int w = row; w < num_worlds; w += f.num_rows) {
        std::byte* place = target + w * world_bytes;
        written.push_back({place, {place, place + world_bytes}});
        take_elements(now, seen, f.dtype, place, f.type, f.count);
        changed[w] = true;
        if (f.constants) derives[w] = true;
      }
    }
  }
  for (int w = 0; w < num_worlds; ++w) {
    if (!changed[w]) continue;
    for (auto& [fields, worlds] : derived_) worlds[w] = 0;
    check_element_indices(worlds_.model_of(w));
  }
  for (int w = 0; w < num_worlds; ++w) {
    if (derives[w]) derive.push_back(w);
  }
  return !written.empty();
}

// Takes the program's model. The worlds keep theirs if it has a value that they cannot have.
void ForeignArrays::take_model() {
  std::vector<Written> written;
  std::vector<int> derived;
  try {
    if (!write_model(written, derived)) return;
    current_.assign(worlds_.size(), 0);
    worlds_.model_changed();
    if (!derived.empty()) derive(derived, {});
  } catch (...) {
    for (const Written& one : written) std::ranges::copy(one.before, one.place);
    if (!derived.empty()) derive(derived, {});
    throw;
  }
  for (ModelField& f : model_fields_) {
    const std::size_t bytes = f.count * dtype_size(f.dtype);
    for (int row = 0; row < f.num_rows; ++row)
      std::memcpy(f.seen.data() + row * bytes, f.rows + row * f.row_bytes, bytes);
  }
}

// Makes MuJoCo derive the values that the program's model does not have (bounding volumes, which frames
// are equal). Those that it has are its own, except those of `released`.
void ForeignArrays::derive(const std::vector<int>& ids, std::span<const std::string> released) {
  mjBatch* batch = worlds_.batch();
  struct Kept {
    std::byte* rows;
    std::size_t bytes;
    std::vector<std::byte> values;
  };
  std::vector<Kept> kept;
  for (const ModelField& f : model_fields_) {
    if (!set_const_use(f.name).out || std::ranges::count(released, f.name) > 0) continue;
    int size = 0, element = 0;
    auto* rows = static_cast<std::byte*>(mjb_expand(batch, f.name.c_str(), &size, &element));
    if (!rows) continue;
    const std::size_t bytes = static_cast<std::size_t>(size) * element;
    Kept& one = kept.emplace_back(Kept{rows, bytes, std::vector<std::byte>(bytes * ids.size())});
    for (std::size_t i = 0; i < ids.size(); ++i)
      std::memcpy(one.values.data() + i * bytes, rows + ids[i] * bytes, bytes);
  }
  const int failed = mjb_setConst(batch, ids.data(), static_cast<int>(ids.size()));
  for (const Kept& one : kept) {
    for (std::size_t i = 0; i < ids.size(); ++i)
      std::memcpy(one.rows + ids[i] * one.bytes, one.values.data() + i * one.bytes, one.bytes);
  }
  for (int w : failed ? ids : std::vector<int>{}) {
    if (*mjb_error(batch, w))
      throw ValueError(
          fmt::format("MuJoCo cannot use the model of world {}: {}", w, mjb_error(batch, w)));
  }
}

void ForeignArrays::set_constants(std::span<const std::string> fields, bool restore) {
  take_model();
  std::vector<std::uint8_t>& derived = derived_[{fields.begin(), fields.end()}];
  derived.resize(worlds_.size());
  std::vector<int> ids;
  for (int w = 0; w < worlds_.size(); ++w)
    if (!derived[w]) ids.push_back(w);
  if (!ids.empty()) {
    // MuJoCo writes the values of each world where it has its own.
    for (const ModelField& f : model_fields_)
      if (f.num_rows > 1 && std::ranges::count(fields, f.name) > 0)
        mjb_expand(worlds_.batch(), f.name.c_str(), nullptr, nullptr);
    derive(ids, fields);
    current_.assign(worlds_.size(), 0);
    worlds_.model_changed();
    for (ModelField& f : model_fields_)
      if (std::ranges::count(fields, f.name) > 0) show_model(f);
    derived.assign(worlds_.size(), 1);
  }
  if (!restore) return;
  call_ = RawCall::kPositions;
  apply(run_world);
}

// Writes the worlds' values of a field into the rows of its array. Worlds that share a row have its values.
void ForeignArrays::show_model(ModelField& f) {
  int size = 0, element = 0;
  auto* rows = static_cast<std::byte*>(
      const_cast<void*>(mjb_expanded(worlds_.batch(), f.name.c_str(), &size, &element)));
  const std::size_t own = static_cast<std::size_t>(size) * element,
                    bytes = f.count * dtype_size(f.dtype);
  for (int row = 0; row < f.num_rows; ++row) {
    const void* values = rows ? rows + own * row : model_values(*worlds_.model(), f.name);
    std::byte* seen = f.seen.data() + row * bytes;
    show_elements(values, f.type, seen, f.dtype, f.count);
    std::memcpy(const_cast<std::byte*>(f.rows) + row * f.row_bytes, seen, bytes);
    for (int w = row + f.num_rows; rows && w < worlds_.size(); w += f.num_rows)
      std::memcpy(rows + own * w, rows + own * row, own);
  }
}

void ForeignArrays::check_capacity() const {
  const int contacts = first_contact_.back() + static_cast<int>(contacts_.back().size());
  if (contacts > max_contacts_)
    throw ValueError(
        fmt::format("the {} worlds have {} contacts, and the data has room for {}: make it with "
                    "nconmax={} or more",
                    worlds_.size(), contacts, max_contacts_,
                    (2 * contacts + worlds_.size() - 1) / worlds_.size()));
  const auto most = std::ranges::max_element(num_constraints_);
  if (*most > max_constraints_)
    throw ValueError(
        fmt::format("world {} has {} rows of constraints, and the data has room for {}: make it "
                    "with njmax={} or more",
                    most - num_constraints_.begin(), *most, max_constraints_, 2 * *most));
}

void ForeignArrays::run(RawCall call, const bool* mask) {
  take_model();
  call_ = call;
  mask_ = mask;
  std::exception_ptr error;
  try {
    apply(run_world);
  } catch (const RuntimeError&) {
    error = std::current_exception();
  }
  number_contacts();
  if (error) std::rethrow_exception(error);
  check_capacity();
}

// Writes the contacts of all worlds, which leave no rows between them.
void ForeignArrays::number_contacts() {
  int contacts = 0;
  for (int w = 0; w < worlds_.size(); ++w) {
    first_contact_[w] = contacts;
    contacts += static_cast<int>(contacts_[w].size());
  }
  for (const ContactField& f : contact_fields_) {
    if (f.made == kCount) *reinterpret_cast<int*>(f.rows) = std::min(contacts, max_contacts_);
  }
  if (contacts > 0 && !contact_fields_.empty()) {
    apply([](const mjModel* m, mjData*, int w, void* argument) {
      static_cast<ForeignArrays*>(argument)->show_contacts(m, w);
    });
  }
}

}  // namespace mjsense::worlds
