// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense/core/system/print_stderr.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/contact/contact_data.h"
#include "mjsense/sensors/contact/contact_field_sensor.h"
#include "mjsense/sensors/contact/contact_fields.h"
#include "mjsense/sensors/contact/contact_pass.h"

namespace mjsense::sensors {
namespace {

bool contains(const std::vector<std::string>& list, std::string_view x) {
  return std::find(list.begin(), list.end(), x) != list.end();
}

}  // namespace

struct ContactSensor::Output {
  int offset;  // of the field's values in a reading; -1: found
  int dim;
  Rows<float> rows, history;  // `history` is empty if there is none
};

ContactSensor::ContactSensor(ContactSensorCfg cfg) : Sensor(cfg.name), cfg_(std::move(cfg)) {}
ContactSensor::~ContactSensor() = default;

bool ContactSensor::wants_substep() const {
  return cfg_.track_air_time || cfg_.history_length > 0 || cfg_.track_events || cfg_.latch;
}

mjtStage ContactSensor::needs() const {
  bool force = cfg_.latch || cfg_.friction_split || cfg_.secondary_policy == "each" ||
               cfg_.reduce == "netforce" ||
               (cfg_.reduce == "maxforce" && (cfg_.other_ids || cfg_.debug_vis));
  for (const std::string& field : cfg_.fields) {
    force |= field == "force" || field == "torque";
    force |= field != "found" && cfg_.reduce == "maxforce";
  }
  return force ? mjSTAGE_ACC : mjSTAGE_POS;
}

void ContactSensor::edit_spec(mjSpec* spec) {
  const ContactNames names(spec);
  primary_names_ = names_of(names.primaries(name(), cfg_.primary), &ContactObject::label);
  secondary_names_.clear();
  if (cfg_.secondary && cfg_.secondary_policy != ContactPolicy::kAny) {
    secondary_names_ = names_of(names.secondaries(name(), *cfg_.secondary, cfg_.secondary_policy),
                                &ContactObject::label);
  }
}

std::vector<std::unique_ptr<Sensor>> ContactSensor::parts() {
  std::vector<std::unique_ptr<Sensor>> parts;
  for (int p = 0; p < static_cast<int>(primary_names_.size()); ++p) {
    for (const std::string& field : cfg_.fields) {
      parts.push_back(std::make_unique<ContactFieldSensor>(this, p, field));
    }
  }
  return parts;
}

void ContactSensor::initialize(const SensorInit& init) {
  const ContactNames names(init.model);
  ContactReducer::Config config;
  config.primaries = names.primaries(name(), cfg_.primary);
  config.primary_mode = cfg_.primary.mode;
  if (cfg_.secondary && cfg_.secondary_policy != ContactPolicy::kAny) {
    config.secondaries = names.secondaries(name(), *cfg_.secondary, cfg_.secondary_policy);
    config.secondary_mode = cfg_.secondary->mode;
  }
  config.reduce = cfg_.reduce;
  if (config.reduce == ContactReduce::kMaxForce && needs() < mjSTAGE_ACC) {
    config.reduce = ContactReduce::kNone;  // no output depends on which contacts the slots hold
  }
  config.num_slots = cfg_.num_slots;
  config.keep_peak = cfg_.latch;
  config.keep_pairs = cfg_.secondary_policy == ContactPolicy::kEach;
  primary_names_ = names_of(config.primaries, &ContactObject::label);
  secondary_names_ = names_of(config.secondaries, &ContactObject::label);
  reducer_ = ContactReducer(init.model, init.num_worlds, config);

  // The pass belongs to the first contact sensor of the scene that is read at the same times and
  // stages.
  pass_ = nullptr;
  if (init.scene) {
    ContactSensor* first = nullptr;
    bool listed = false;
    for (const std::unique_ptr<Sensor>& s : init.scene->sensors()) {
      auto* contact = dynamic_cast<ContactSensor*>(s.get());
      if (!contact || contact->wants_substep() != wants_substep() || contact->needs() != needs())
        continue;
      if (!first) first = contact;
      listed |= contact == this;
    }
    if (listed && first != this) pass_ = first->pass_;
  }
  if (!pass_) pass_ = std::make_shared<ContactPass>(init.model, init.num_worlds);
  pass_->join(&reducer_);

  const std::size_t n = static_cast<std::size_t>(init.num_worlds) * reducer_.num_primaries();
  written_moment_.assign(init.num_worlds, 0);
  written_.assign(n, 0);
  num_written_.assign(init.num_worlds, 0);
  history_left_.assign(cfg_.history_length > 0 ? n * cfg_.num_slots : 0, 0);
  add_outputs(init);
  if (cfg_.debug) {
    print_stderr("sensor '{}': primaries {}; secondaries {}\n", name(),
                 fmt::join(primary_names_, ", "), fmt::join(secondary_names_, ", "));
  }
}

void ContactSensor::add_outputs(const SensorInit& init) {
  clear_fields();
  outputs_.clear();
  other_geom_ = other_body_ = {};
  pair_found_ = pair_force_ = {};
  const std::int64_t P = reducer_.num_primaries(), S = reducer_.num_secondaries();
  const std::int64_t N = P * cfg_.num_slots, H = cfg_.history_length;
  const bool world_axes = cfg_.global_frame || reducer_.is_net();
  const int B = init.num_worlds;
  const auto add = [&](const std::string& field, Shape shape) -> Array& {
    const std::string frame = contact_field_frame(field, world_axes);
    SensorSpec spec = kContactData.spec(field, shape, frame);
    if (field == "found") spec.low = 0.0;
    return add_field(field, std::move(spec), B).data;
  };
  const auto rows = [&](const std::string& field, Shape shape) {
    return Rows<float>(add(field, shape));
  };
  const auto flags = [&](const std::string& field) { return Rows<bool>(add(field, {P})); };

  needs_wrench_ = cfg_.friction_split;
  const auto add_slots = [&](const std::string& field) {
    const int offset = contact_field_offset(field);
    const bool vector = field != "found" && field != "dist";
    outputs_.push_back({offset, vector ? 3 : 1, rows(field, vector ? Shape{N, 3} : Shape{N}), {}});
    needs_wrench_ |= field == "force" || field == "torque";
  };
  for (const std::string& field : cfg_.fields) add_slots(field);
  if (cfg_.friction_split) {
    add_slots("normal_force");
    add_slots("friction_force");
  }
  for (std::size_t i = 0; H > 0 && i < cfg_.fields.size(); ++i) {
    outputs_[i].history =
        rows(cfg_.fields[i] + "_history", outputs_[i].dim == 3 ? Shape{N, H, 3} : Shape{N, H});
  }

  if (cfg_.other_ids) {
    const auto ids = [&](const char* field) {
      Array& data = add(field, {N});
      std::ranges::fill(data.all<std::int32_t>(), -1);
      return Rows<std::int32_t>(data);
    };
    other_geom_ = ids("other_geom");
    other_body_ = ids("other_body");
  }
  if (cfg_.secondary_policy == ContactPolicy::kEach) {
    pair_found_ = rows("pair_found", {P, S});
    pair_force_ = rows("pair_force", {P, S, 3});
  }

  ContactMemory::Fields m;
  if (cfg_.track_air_time) {
    m.current_air = rows("current_air_time", {P});
    m.last_air = rows("last_air_time", {P});
    m.current_contact = rows("current_contact_time", {P});
    m.last_contact = rows("last_contact_time", {P});
    if (!contains(cfg_.fields, "found")) m.current_air = {};  // the timers stay 0, as in mjlab
  }
  if (cfg_.track_events) {
    m.touchdown = flags("touchdown");
    m.liftoff = flags("liftoff");
  }
  if (cfg_.latch) {
    m.found_any = flags("found_any");
    m.force_peak = rows("force_peak", {P, 3});
    m.dist_at_peak = rows("dist_at_peak", {P});
    m.pos_at_peak = rows("pos_at_peak", {P, 3});
    m.first_touch_time = rows("first_touch_time", {P});
  }
  memory_ = ContactMemory(B, static_cast<int>(P), init.decimation, m);
}

void ContactSensor::compute(const World& world) {
  pass_->run(world);
  if (world.moment == 0 || written_moment_[world.id] != world.moment) write_rows(world);
}

void ContactSensor::substep(const World& world) {
  compute(world);
  memory_.next_substep(world, reducer_);
  if (memory_.wants_contacts()) remember(world);
  if (cfg_.history_length > 0) write_history(world.id);
}

void ContactSensor::remember(const World& world) {
  const int w = world.id;
  for (int p : reducer_.touched(w)) {
    if (reducer_.is_net()) {
      const ContactSum& sum = reducer_.sum(w, p);
      if (!memory_.add_contact(w, p, mju_norm3(sum.force))) continue;
      memory_.set_peak(w, p, read_net_contact(world, sum));
    } else {
      const ContactRef& peak = reducer_.peak(w, p);
      if (!memory_.add_contact(w, p, -peak.key)) continue;
      memory_.set_peak(w, p, read_contact(world, peak, true, cfg_.global_frame));
    }
  }
}

void ContactSensor::reset(const World& world) {
  const int w = world.id;
  memory_.reset(w);
  for (const Output& o : outputs_) {
    if (o.history) o.history.fill(w, 0.0f);
  }
  if (cfg_.history_length > 0) {
    const std::size_t n = static_cast<std::size_t>(reducer_.num_primaries()) * cfg_.num_slots;
    std::fill_n(history_left_.begin() + w * n, n, 0);
  }
}

int ContactSensor::read_slot(const World& world, int primary, int slot,
                             ContactReading& reading) const {
  const int count = reducer_.count(world.id, primary);
  if (slot >= (reducer_.is_net() ? std::min(count, 1) : count)) return 0;
  reading = reducer_.is_net()
                ? read_net_contact(world, reducer_.sum(world.id, primary))
                : read_contact(world, reducer_.slot(world.id, primary, slot), needs_wrench_, false);
  return count;
}

void ContactSensor::write_rows(const World& world) {
  const int w = world.id, K = cfg_.num_slots;
  const std::size_t P = reducer_.num_primaries();
  int& num_written = num_written_[w];
  int* written = written_.data() + w * P;
  for (int i = 0; i < num_written; ++i) {
    if (reducer_.count(w, written[i]) == 0) clear_rows(w, written[i], 0);
  }
  num_written = 0;
  for (int p : reducer_.touched(w)) {
    written[num_written++] = p;
    const int count = reducer_.count(w, p);
    const int filled = reducer_.is_net() ? 1 : std::min(count, K);
    if (reducer_.is_net()) {
      write_slot(w, p * K, count, read_net_contact(world, reducer_.sum(w, p)));
    } else {
      for (int k = 0; k < filled; ++k) {
        write_slot(w, p * K + k, count,
                   read_contact(world, reducer_.slot(w, p, k), needs_wrench_, cfg_.global_frame));
      }
    }
    if (filled < K) clear_rows(w, p, filled);
    if (pair_found_) {
      const std::size_t S = reducer_.num_secondaries();
      std::copy_n(reducer_.pair_count(w).data() + p * S, S, pair_found_(w) + p * S);
      std::copy_n(reducer_.pair_force(w).data() + p * S * 3, S * 3, pair_force_(w) + p * S * 3);
    }
  }
  written_moment_[w] = world.moment;
}

// Clears the slots of a primary from `first_slot` on, and its pairs if that is all slots.
void ContactSensor::clear_rows(int w, int primary, int first_slot) {
  const std::size_t slot = static_cast<std::size_t>(primary) * cfg_.num_slots + first_slot;
  const std::size_t n = cfg_.num_slots - first_slot, S = reducer_.num_secondaries();
  for (const Output& o : outputs_) std::fill_n(o.rows(w) + slot * o.dim, n * o.dim, 0.0f);
  if (other_geom_) {
    std::fill_n(other_geom_(w) + slot, n, -1);
    std::fill_n(other_body_(w) + slot, n, -1);
  }
  if (pair_found_ && first_slot == 0) {
    std::fill_n(pair_found_(w) + primary * S, S, 0.0f);
    std::fill_n(pair_force_(w) + primary * S * 3, S * 3, 0.0f);
  }
}

void ContactSensor::write_slot(int w, int slot, int found, const ContactReading& reading) {
  for (const Output& o : outputs_) {
    float* row = o.rows(w) + static_cast<std::size_t>(slot) * o.dim;
    if (o.offset < 0) {
      *row = static_cast<float>(found);
      continue;
    }
    const double* values = contact_values(reading, o.offset);
    row[0] = static_cast<float>(values[0]);
    if (o.dim == 1) continue;
    row[1] = static_cast<float>(values[1]);
    row[2] = static_cast<float>(values[2]);
  }
  if (other_geom_) {
    other_geom_(w)[slot] = reading.other_geom;
    other_body_(w)[slot] = reading.other_body;
  }
}

// Shifts the history of every slot by one substep. A slot that has been empty for H substeps is all
// zero and is skipped. Other slots are shifted together if they are adjacent.
void ContactSensor::write_history(int w) {
  const int K = cfg_.num_slots, P = reducer_.num_primaries();
  std::uint16_t* left = history_left_.data() + static_cast<std::size_t>(w) * P * K;
  int begin = -1;  // of the run of slots to shift, -1: none
  for (int p = 0, n = 0; p < P; ++p) {
    const int count = reducer_.count(w, p);
    const int filled = reducer_.is_net() ? std::min(count, 1) : count;
    for (int k = 0; k < K; ++k, ++n) {
      const bool live = k < filled || left[n] > 0;
      if (k < filled) {
        left[n] = static_cast<std::uint16_t>(cfg_.history_length);
      } else if (live) {
        --left[n];
      }
      if (live && begin < 0) begin = n;
      if (!live && begin >= 0) {
        shift_history(w, begin, n);
        begin = -1;
      }
    }
  }
  if (begin >= 0) shift_history(w, begin, P * K);
}

// Shifts all slots [begin, end) in one move. Values that cross a slot's border are overwritten
// afterwards.
void ContactSensor::shift_history(int w, int begin, int end) {
  const std::size_t H = cfg_.history_length;
  for (const Output& o : outputs_) {
    if (!o.history) continue;
    const std::size_t dim = o.dim;
    float* history = o.history(w) + begin * H * dim;
    const float* row = o.rows(w) + begin * dim;
    const std::size_t n = end - begin;
    std::memmove(history + dim, history, (n * H - 1) * dim * sizeof(float));
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t i = 0; i < dim; ++i) history[k * H * dim + i] = row[k * dim + i];
    }
  }
}

Array ContactSensor::first(double dt, double abs_tol, std::string_view field_name) const {
  if (!cfg_.track_air_time) {
    throw RuntimeError(
        fmt::format("sensor '{}' does not track air time: set track_air_time", name()));
  }
  const Array& time = field(field_name).data;
  Array result(DType::kBool, time.shape());
  std::ranges::transform(time.all<float>(), result.all<bool>().begin(),
                         [&](float t) { return t > 0.0f && t < dt + abs_tol; });
  return result;
}

Array ContactSensor::compute_first_contact(double dt, double abs_tol) const {
  return first(dt, abs_tol, "current_contact_time");
}

Array ContactSensor::compute_first_air(double dt, double abs_tol) const {
  return first(dt, abs_tol, "current_air_time");
}

}  // namespace mjsense::sensors
