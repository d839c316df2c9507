#include "mjsense/sensors/contact/contact_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/contact/contact_field_sensor.h"
#include "mjsense/sensors/contact/contact_pass.h"

namespace mjsense {
namespace {

const std::vector<std::string> kFields = {"found", "force",  "torque", "dist",
                                          "pos",   "normal", "tangent"};

bool contains(const std::vector<std::string>& list, std::string_view x) {
  return std::find(list.begin(), list.end(), x) != list.end();
}

std::vector<std::string> labels_of(const std::vector<ContactObject>& objects) {
  std::vector<std::string> labels;
  for (const ContactObject& o : objects) labels.push_back(o.label);
  return labels;
}

SensorSpec make_spec(Shape shape, DType dtype, std::string unit, std::string frame,
                     std::string description) {
  SensorSpec spec;
  spec.dtype = dtype;
  spec.shape = shape;
  spec.unit = std::move(unit);
  spec.frame = std::move(frame);
  spec.description = std::move(description);
  return spec;
}

}  // namespace

struct ContactSensor::Output {
  const double* (*values)(const ContactReading&);  // null: found
  int dim;
  Array* rows;
  Array* history;  // null: none
};

SensorSpec contact_field_spec(std::string_view field, bool world_axes) {
  const std::string axes = world_axes ? "world" : "contact";
  SensorSpec s;
  if (field == "found") {
    s = make_spec({}, DType::kFloat32, "", "", "Number of matching contacts, 0 in an empty slot.");
    s.low = 0.0;
  } else if (field == "force") {
    s = make_spec({3}, DType::kFloat32, "N", axes, "Force of the primary on the other side.");
  } else if (field == "torque") {
    s = make_spec({3}, DType::kFloat32, "N m", axes, "Torque of the primary on the other side.");
  } else if (field == "dist") {
    s = make_spec({}, DType::kFloat32, "m", "", "Signed distance, negative in penetration.");
  } else if (field == "pos") {
    s = make_spec({3}, DType::kFloat32, "m", "world", "Contact point.");
  } else if (field == "normal") {
    s = make_spec({3}, DType::kFloat32, "", "world", "Unit normal, from the primary outwards.");
  } else if (field == "tangent") {
    s = make_spec({3}, DType::kFloat32, "", "world", "Unit vector of the contact frame's y axis.");
  } else {
    throw_unknown("contact sensor", "field", field, kFields);
  }
  return s;
}

namespace {

using Values = const double* (*)(const ContactReading&);

Values values_of(std::string_view field) {
  if (field == "force") return [](const ContactReading& r) { return +r.force; };
  if (field == "torque") return [](const ContactReading& r) { return +r.torque; };
  if (field == "dist") return [](const ContactReading& r) { return &r.dist; };
  if (field == "pos") return [](const ContactReading& r) { return +r.pos; };
  if (field == "normal") return [](const ContactReading& r) { return +r.normal; };
  if (field == "tangent") return [](const ContactReading& r) { return +r.tangent; };
  return nullptr;
}

}  // namespace

const double* contact_field_values(std::string_view field, const ContactReading& reading) {
  return values_of(field)(reading);
}

std::unique_ptr<Sensor> ContactSensorCfg::build() const {
  const std::string place = fmt::format("sensor '{}'", name);
  if (fields.empty()) throw ValueError(fmt::format("{}: no fields are asked for", place));
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (!contains(kFields, fields[i])) throw_unknown(place, "field", fields[i], kFields);
    if (std::count(fields.begin(), fields.end(), fields[i]) > 1) {
      throw ValueError(fmt::format("{}: field '{}' is asked for twice", place, fields[i]));
    }
  }
  const ContactReduce how = contact_reduce_from_name(reduce, place);
  if (num_slots < 1) {
    throw ValueError(fmt::format("{}: num_slots is {}: must be at least 1", place, num_slots));
  }
  if (history_length > 65535) {
    throw ValueError(fmt::format("{}: history_length is {}: at most 65535", place, history_length));
  }
  const std::vector<std::string> policies = {"first", "any", "error", "each"};
  if (!contains(policies, secondary_policy)) {
    throw ValueError(fmt::format("{}: secondary_policy '{}'{}", place, secondary_policy,
                                 suggest(secondary_policy, policies)));
  }
  if (secondary_policy == "each" && !secondary) {
    throw ValueError(fmt::format("{}: secondary_policy 'each' needs a secondary", place));
  }
  if (global_frame && how != ContactReduce::kNetForce &&
      !(contains(fields, "normal") && contains(fields, "tangent"))) {
    throw ValueError(
        fmt::format("{}: global_frame needs 'normal' and 'tangent' among fields", place));
  }
  return std::make_unique<ContactSensor>(*this);
}

ContactSensor::ContactSensor(ContactSensorCfg cfg) : Sensor(cfg.name), cfg_(std::move(cfg)) {}
ContactSensor::~ContactSensor() = default;

bool ContactSensor::wants_substep() const {
  return cfg_.track_air_time || cfg_.history_length > 0 || cfg_.track_events || cfg_.latch;
}

void ContactSensor::edit_spec(mjSpec* spec) {
  const ContactNames names(spec);
  primary_names_ = labels_of(names.primaries(name(), cfg_.primary));
  secondary_names_.clear();
  if (cfg_.secondary && cfg_.secondary_policy != "any") {
    secondary_names_ = labels_of(names.secondaries(name(), *cfg_.secondary, cfg_.secondary_policy));
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
  if (cfg_.secondary && cfg_.secondary_policy != "any") {
    config.secondaries = names.secondaries(name(), *cfg_.secondary, cfg_.secondary_policy);
    config.secondary_mode = cfg_.secondary->mode;
  }
  config.reduce = contact_reduce_from_name(cfg_.reduce, name());
  config.num_slots = cfg_.num_slots;
  config.keep_peak = cfg_.latch;
  config.keep_pairs = cfg_.secondary_policy == "each";
  primary_names_ = labels_of(config.primaries);
  secondary_names_ = labels_of(config.secondaries);
  reducer_ = ContactReducer(init.model, init.num_worlds, config);

  // The first contact sensor of the scene that is read at the same times owns the pass.
  pass_ = nullptr;
  if (init.scene) {
    ContactSensor* first = nullptr;
    bool listed = false;
    for (const std::unique_ptr<Sensor>& s : init.scene->sensors()) {
      auto* contact = dynamic_cast<ContactSensor*>(s.get());
      if (!contact || contact->wants_substep() != wants_substep()) continue;
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
    fmt::print(stderr, "sensor '{}': primaries {}; secondaries {}\n", name(),
               fmt::join(primary_names_, ", "), fmt::join(secondary_names_, ", "));
  }
}

void ContactSensor::add_outputs(const SensorInit& init) {
  clear_fields();
  outputs_.clear();
  const std::int64_t P = reducer_.num_primaries(), S = reducer_.num_secondaries();
  const std::int64_t N = P * cfg_.num_slots, H = cfg_.history_length;
  const bool world_axes = cfg_.global_frame || reducer_.is_net();
  const int B = init.num_worlds;
  const auto add = [&](const char* field, SensorSpec spec) {
    return &add_field(field, std::move(spec), B);
  };

  needs_wrench_ = cfg_.friction_split;
  for (const std::string& field : cfg_.fields) {
    SensorSpec spec = contact_field_spec(field, world_axes);
    const bool vector = spec.shape.rank() == 1;
    spec.shape = vector ? Shape{N, 3} : Shape{N};
    outputs_.push_back(
        {values_of(field), vector ? 3 : 1, &add(field.c_str(), spec)->data, nullptr});
    needs_wrench_ |= field == "force" || field == "torque";
  }
  if (cfg_.friction_split) {
    const std::string axes = world_axes ? "world" : "contact";
    const auto part = [&](const char* field, const char* text) {
      return &add(field, make_spec({N, 3}, DType::kFloat32, "N", axes, text))->data;
    };
    outputs_.push_back({[](const ContactReading& r) { return +r.normal_force; }, 3,
                        part("normal_force", "Normal part of force."), nullptr});
    outputs_.push_back({[](const ContactReading& r) { return +r.friction_force; }, 3,
                        part("friction_force", "Tangential part of force."), nullptr});
  }
  for (std::size_t i = 0; H > 0 && i < cfg_.fields.size(); ++i) {
    SensorSpec spec = contact_field_spec(cfg_.fields[i], world_axes);
    spec.shape = outputs_[i].dim == 3 ? Shape{N, H, 3} : Shape{N, H};
    spec.description += " The last substeps, newest first.";
    outputs_[i].history = &add((cfg_.fields[i] + "_history").c_str(), spec)->data;
  }

  if (cfg_.other_ids) {
    const auto id = [&](const char* field, const char* text) {
      Field* f = add(field, make_spec({N}, DType::kInt32, "", "", text));
      std::ranges::fill(f->data.all<std::int32_t>(), -1);
      return f;
    };
    other_geom_ = id("other_geom", "MuJoCo geom id of the other side, -1 if none.");
    other_body_ = id("other_body", "MuJoCo body id of the other side, -1 if none.");
  }
  if (cfg_.secondary_policy == "each") {
    pair_found_ = add("pair_found", make_spec({P, S}, DType::kFloat32, "", "",
                                              "Number of contacts of primary and secondary."));
    pair_force_ = add("pair_force", make_spec({P, S, 3}, DType::kFloat32, "N", "world",
                                              "Net force of the primary on the secondary."));
  }

  ContactMemory::Fields m;
  const auto seconds = [&](const char* field, const char* text) {
    return &add(field, make_spec({P}, DType::kFloat32, "s", "", text))->data;
  };
  const auto flag = [&](const char* field, const char* text) {
    return &add(field, make_spec({P}, DType::kBool, "", "", text))->data;
  };
  if (cfg_.track_air_time) {
    m.current_air = seconds("current_air_time", "Time since the contact was lost.");
    m.last_air = seconds("last_air_time", "Length of the last phase in the air.");
    m.current_contact = seconds("current_contact_time", "Time since the contact began.");
    m.last_contact = seconds("last_contact_time", "Length of the last contact.");
    if (!contains(cfg_.fields, "found")) m.current_air = nullptr;
  }
  if (cfg_.track_events) {
    m.touchdown = flag("touchdown", "A contact began in this control step.");
    m.liftoff = flag("liftoff", "A contact ended in this control step.");
  }
  if (cfg_.latch) {
    const std::string axes = world_axes ? "world" : "contact";
    m.found_any = flag("found_any", "There was a contact in this control step.");
    m.force_peak = &add("force_peak", make_spec({P, 3}, DType::kFloat32, "N", axes,
                                                "Strongest force of this control step."))
                        ->data;
    m.dist_at_peak = &add("dist_at_peak", make_spec({P}, DType::kFloat32, "m", "",
                                                    "Signed distance at the strongest force."))
                          ->data;
    m.pos_at_peak = &add("pos_at_peak", make_spec({P, 3}, DType::kFloat32, "m", "world",
                                                  "Contact point of the strongest force."))
                         ->data;
    m.first_touch_time = seconds("first_touch_time",
                                 "From the start of the control step to its first contact, or -1.");
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
  if (memory_.wants_strikes()) remember(world);
  if (cfg_.history_length > 0) write_history(world.id);
}

void ContactSensor::remember(const World& world) {
  const bool world_axes = cfg_.global_frame;
  for (int p : reducer_.touched(world.id)) {
    const ContactReading r =
        reducer_.is_net() ? read_net_contact(world, reducer_.sum(world.id, p))
                          : read_contact(world, reducer_.peak(world.id, p), true, world_axes);
    memory_.strike(world, p, mju_norm3(r.force), r);
  }
}

void ContactSensor::reset(const World& world) {
  const int w = world.id;
  if (cfg_.track_events) pass_->run(world);
  memory_.reset(w, reducer_);
  for (const Output& o : outputs_) {
    if (o.history) std::fill_n(o.history->row_data(w), o.history->row_bytes(), std::byte{0});
  }
  if (cfg_.history_length > 0) {
    const std::size_t n = static_cast<std::size_t>(reducer_.num_primaries()) * cfg_.num_slots;
    std::fill_n(history_left_.begin() + w * n, n, 0);
  }
}

void ContactSensor::begin_control_step(int world) { memory_.begin_control_step(world); }

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
  clear_rows(w);
  int& num_written = num_written_[w];
  int* written = written_.data() + static_cast<std::size_t>(w) * reducer_.num_primaries();
  for (int p : reducer_.touched(w)) {
    written[num_written++] = p;
    const int count = reducer_.count(w, p);
    if (reducer_.is_net()) {
      write_slot(w, p * K, count, read_net_contact(world, reducer_.sum(w, p)));
      continue;
    }
    for (int k = 0; k < std::min(count, K); ++k) {
      write_slot(w, p * K + k, count,
                 read_contact(world, reducer_.slot(w, p, k), needs_wrench_, cfg_.global_frame));
    }
  }
  if (pair_found_) {
    const std::size_t S = reducer_.num_secondaries();
    float* found = pair_found_->data.row<float>(w).data();
    float* force = pair_force_->data.row<float>(w).data();
    for (int p : reducer_.touched(w)) {
      std::copy_n(reducer_.pair_count(w).data() + p * S, S, found + p * S);
      std::copy_n(reducer_.pair_force(w).data() + p * S * 3, S * 3, force + p * S * 3);
    }
  }
  written_moment_[w] = world.moment;
}

void ContactSensor::clear_rows(int w) {
  const int* written = written_.data() + static_cast<std::size_t>(w) * reducer_.num_primaries();
  const std::size_t K = cfg_.num_slots, S = reducer_.num_secondaries();
  for (int i = 0; i < num_written_[w]; ++i) {
    const std::size_t p = written[i];
    for (const Output& o : outputs_) {
      std::fill_n(o.rows->row<float>(w).data() + p * K * o.dim, K * o.dim, 0.0f);
    }
    if (other_geom_) {
      std::fill_n(other_geom_->data.row<std::int32_t>(w).data() + p * K, K, -1);
      std::fill_n(other_body_->data.row<std::int32_t>(w).data() + p * K, K, -1);
    }
    if (pair_found_) {
      std::fill_n(pair_found_->data.row<float>(w).data() + p * S, S, 0.0f);
      std::fill_n(pair_force_->data.row<float>(w).data() + p * S * 3, S * 3, 0.0f);
    }
  }
  num_written_[w] = 0;
}

void ContactSensor::write_slot(int w, int slot, int found, const ContactReading& reading) {
  for (const Output& o : outputs_) {
    float* row = o.rows->row<float>(w).data() + static_cast<std::size_t>(slot) * o.dim;
    if (!o.values) {
      *row = static_cast<float>(found);
      continue;
    }
    const double* values = o.values(reading);
    for (int i = 0; i < o.dim; ++i) row[i] = static_cast<float>(values[i]);
  }
  if (other_geom_) {
    other_geom_->data.row<std::int32_t>(w)[slot] = reading.other_geom;
    other_body_->data.row<std::int32_t>(w)[slot] = reading.other_body;
  }
}

// Shifts every slot by one substep. A slot that has been empty for H substeps is all zero and
// skipped.
void ContactSensor::write_history(int w) {
  const int K = cfg_.num_slots, N = reducer_.num_primaries() * K;
  const std::size_t H = cfg_.history_length;
  for (int n = 0; n < N; ++n) {
    std::uint16_t& left = history_left_[static_cast<std::size_t>(w) * N + n];
    const int count = reducer_.count(w, n / K);
    const bool filled = n % K < (reducer_.is_net() ? std::min(count, 1) : count);
    if (filled) {
      left = static_cast<std::uint16_t>(H);
    } else if (left > 0) {
      --left;
    } else {
      continue;
    }
    for (const Output& o : outputs_) {
      if (!o.history) continue;
      float* h = o.history->row<float>(w).data() + n * H * o.dim;
      std::memmove(h + o.dim, h, (H - 1) * o.dim * sizeof(float));
      std::copy_n(o.rows->row<float>(w).data() + static_cast<std::size_t>(n) * o.dim, o.dim, h);
    }
  }
}

Array ContactSensor::first(double dt, double abs_tol, std::string_view field_name) const {
  if (!cfg_.track_air_time) {
    throw RuntimeError(fmt::format("sensor '{}': track_air_time is off", name()));
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

}  // namespace mjsense
