// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>

#include "mjsense/core/error.h"
#include "mjsense/worlds/foreign_fields.h"

namespace mjsense::worlds {
namespace {

constexpr std::string_view kControls[] = {"ctrl", "qfrc_applied", "xfrc_applied", "qacc_warmstart"};
// Fields that a reset shows in addition to the state.
constexpr std::string_view kReset[] = {"qacc", "act_dot", "sensordata", "energy",
                                       "ne",   "nf",      "nl",         "nefc"};
// Fields of constraints that mj_step1 does not compute.
constexpr std::string_view kSolved[] = {"efc_state", "efc_force"};
// Fields that kPositions shows.
// clang-format off
constexpr std::string_view kPositions[] = {
    "xpos", "xquat", "xmat", "xipos", "ximat", "xanchor", "xaxis", "geom_xpos", "geom_xmat",
    "site_xpos", "site_xmat", "cam_xpos", "cam_xmat", "light_xpos", "light_xdir", "subtree_com",
    "cdof", "cinert", "flexvert_xpos", "flexedge_J", "flexedge_length", "ten_wrapadr",
    "ten_wrapnum", "ten_J", "ten_length", "wrap_obj", "wrap_xpos", "actuator_length",
    "moment_rownnz", "moment_rowadr", "moment_colind", "actuator_moment", "crb", "M"};
// clang-format on
constexpr std::string_view kPoses[] = {"geom_xpos", "geom_xmat",  "cam_xpos",
                                       "cam_xmat",  "light_xpos", "light_xdir"};

}  // namespace

void ForeignData::clear(int max_constraints) {
  fields_.clear();
  max_constraints_ = max_constraints;
}

bool ForeignData::add(const mjModel* m, std::string_view field, const ArrayView& rows, bool input) {
  const std::optional<DataField> found = data_field(m, field);
  const auto count = static_cast<int>(rows.shape[1]);
  if (!found || !converts(found->type, rows.dtype) ||
      (!found->constraints && found->count != count))
    return false;
  const auto is_in = [&](const auto& names) {
    return std::ranges::find(names, field) != std::end(names);
  };
  Field& added = fields_.emplace_back(Field{.type = found->type,
                                            .dtype = rows.dtype,
                                            .count = count,
                                            .constraints = found->constraints,
                                            .input = input,
                                            .reset = input || is_in(kReset),
                                            .control = is_in(kControls),
                                            .solved = is_in(kSolved),
                                            .poses = is_in(kPoses),
                                            .positions = is_in(kPositions),
                                            .pointer = found->pointer,
                                            .rows = rows.data,
                                            .row_bytes = static_cast<std::size_t>(rows.strides[0]),
                                            .seen = {}});
  if (found->constraints) max_constraints_ = std::min(max_constraints_, count);
  if (input) added.seen.resize(count * dtype_size(rows.dtype) * num_constraints_.size());
  return true;
}

void ForeignData::see_initial(const mjData* d, int w) {
  Field& f = fields_.back();
  const std::size_t bytes = f.count * dtype_size(f.dtype);
  show_elements(f.pointer(d), f.type, f.seen.data() + w * bytes, f.dtype, f.count);
}

bool ForeignData::take(mjData* d, int w) const {
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

void ForeignData::take_shown(mjData* d, int w, bool poses_only) const {
  for (const Field& f : fields_) {
    if (f.input || f.constraints || f.type != DType::kFloat64 || (poses_only && !f.poses)) continue;
    const auto* row = reinterpret_cast<const float*>(f.rows + w * f.row_bytes);
    auto* to = static_cast<mjtNum*>(const_cast<void*>(f.pointer(d)));
    for (int i = 0; i < f.count; ++i) {
      if (std::isfinite(row[i]) && static_cast<float>(to[i]) != row[i]) to[i] = row[i];
    }
  }
}

bool ForeignData::Field::is_in(RawCall call) const {
  switch (call) {
    case RawCall::kReset:
      return reset;
    case RawCall::kStep1:
      return !solved;
    case RawCall::kPositions:
      return positions;
    default:
      return true;
  }
}

void ForeignData::show(const mjData* d, int w, RawCall call) {
  for (Field& f : fields_) {
    if (!f.is_in(call)) continue;
    const std::int64_t n = f.constraints ? std::min(f.count, d->nefc) : f.count;
    std::byte* row = f.rows + w * f.row_bytes;
    show_elements(f.pointer(d), f.type, row, f.dtype, n);
    if (f.input)
      std::memcpy(f.seen.data() + w * n * dtype_size(f.dtype), row, n * dtype_size(f.dtype));
  }
  if (call != RawCall::kPositions) num_constraints_[w] = d->nefc;
}

void ForeignData::show_diverged(int w) const {
  for (const Field& f : fields_) {
    auto* row = reinterpret_cast<float*>(f.rows + w * f.row_bytes);
    if (f.dtype == DType::kFloat32 && !f.input)
      std::fill_n(row, f.count, std::numeric_limits<float>::quiet_NaN());
  }
}

void ForeignData::check_capacity() const {
  const auto most = std::ranges::max_element(num_constraints_);
  if (*most > max_constraints_)
    throw ValueError(
        fmt::format("world {} has {} rows of constraints, and the data has room for {}: make it "
                    "with njmax={} or more",
                    most - num_constraints_.begin(), *most, max_constraints_, 2 * *most));
}

}  // namespace mjsense::worlds
