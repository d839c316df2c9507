// SPDX-License-Identifier: Apache-2.0
#pragma once
// Contacts of chosen geoms, bodies or subtrees (primaries), with anything or only with chosen
// others (secondaries).
//
// Sign and frame. The normal points from the primary to the other side. The force is what the
// PRIMARY EXERTS ON THE OTHER: a box on the floor reads (0, 0, -m g) in the world frame; make the
// floor the primary to read the ground reaction. Components are in the contact frame (x = normal, y
// = tangent, z = normal x tangent), hence force[0] >= 0 without adhesion; with global_frame, and
// always with reduce = netforce, they are in the world frame.
//
// All contact sensors of a scene share one pass over mjData.contact (contact_pass.h).

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_match.h"
#include "mjsense/sensors/contact/contact_memory.h"
#include "mjsense/sensors/contact/contact_reducer.h"

namespace mjsense::sensors {

class ContactPass;

struct ContactVizCfg {
  bool show_points = true, show_frames = true, show_forces = true;
  double force_scale = 0.0;
  std::array<float, 4> point_color{1, 0.5f, 0, 1};
  std::array<float, 4> force_color{0.9f, 0.1f, 0.9f, 1};
  double point_radius = 0.3, axis_length = 2.0, force_width = 0.3;
};
template <class V>
void visit_fields(V& v, ContactVizCfg& c) {
  v.object("ContactVizCfg",
           "The debug drawing of every contact in a slot. Colours are rgba, sizes are in units of "
           "the model's ``stat.meansize``.");
  v("show_points", c.show_points, "Draw a sphere at the contact point.");
  v("show_frames", c.show_frames,
    "Draw the axes of the contact frame: x (red) is the normal, from the primary to the "
    "secondary.");
  v("show_forces", c.show_forces,
    "Draw the force that the primary exerts on the secondary, as an arrow that ends at the contact "
    "point.");
  v("force_scale", c.force_scale,
    "Length of the arrow per newton; 0: the model's ``vis.map.force``, as for MuJoCo's own arrows.")
      .unit("m/N")
      .at_least(0);
  v("point_color", c.point_color, "Colour of the spheres.").within(0, 1);
  v("force_color", c.force_color, "Colour of the arrows.").within(0, 1);
  v("point_radius", c.point_radius, "Radius of the spheres.").at_least(0);
  v("axis_length", c.axis_length, "Length of the axes.").at_least(0);
  v("force_width", c.force_width, "Width of the arrows.").at_least(0);
}

struct ContactSensorCfg : SensorCfg {
  ContactMatch primary;
  std::optional<ContactMatch> secondary;
  std::vector<std::string> fields = {"found", "force"};
  NamedEnum<ContactReduce> reduce = ContactReduce::kMaxForce;
  int num_slots = 1;
  NamedEnum<ContactPolicy> secondary_policy;
  bool track_air_time = false;
  bool global_frame = false;
  int history_length = 0;

  // Beyond mjlab. All of these are exact: they use every substep, and every contact instead of only
  // those in the slots.
  bool track_events = false;
  bool latch = false;
  bool friction_split = false;
  bool other_ids = false;

  bool debug = false;
  bool debug_vis = false;
  ContactVizCfg viz;

  std::unique_ptr<Sensor> build() const override;  // throws ValueError or KeyError
};

inline constexpr std::array<std::string_view, 7> kContactFields{"found", "force",  "torque", "dist",
                                                                "pos",   "normal", "tangent"};

template <class V>
void visit_fields(V& v, ContactSensorCfg& c) {
  v.object("ContactSensorCfg",
           "Contacts of primaries, optionally with one secondary only. ``data`` is a "
           ":class:`mjsense.sensors.ContactData`.\n\n"
           "The normal points from the primary to the secondary; forces are what the **primary "
           "exerts on the secondary**: a box on the floor reads (0, 0, -m g) in the world frame.",
           "contact");
  v.extends(static_cast<SensorCfg&>(c));
  v("primary", c.primary, "The geoms or bodies whose contacts are measured.").required();
  v("secondary", c.secondary, "The other side of the contacts; None: anything.");
  v("fields", c.fields, "The quantities measured for each contact.")
      .one_of(kContactFields)
      .not_empty();
  v("reduce", c.reduce,
    "Order in which contacts fill the slots. none: MuJoCo's order; mindist: deepest first; "
    "maxforce: strongest first; netforce: one synthetic contact at the force-weighted centroid, "
    "with the net wrench in the world frame.");
  v("num_slots", c.num_slots, "S, number of contacts kept for each primary.").at_least(1);
  v("secondary_policy", c.secondary_policy,
    "What to do if several elements match the secondary. first: use the first in model order; "
    "error: raise an error; any: no filter, the secondary is ignored; each: use every match, and "
    "report which pairs touch.");
  v("track_air_time", c.track_air_time,
    "Measure the durations of flight and contact; they stay 0 unless found is among the fields, as "
    "in mjlab.");
  v("global_frame", c.global_frame,
    "Report forces and torques in the world frame instead of the contact frame (x = normal); "
    "requires normal and tangent.");
  v("history_length", c.history_length,
    "H, number of substeps kept of every field, newest first; 0 or less: none.")
      .at_most(65535);
  v("track_events", c.track_events,
    "Report touchdown and liftoff, exactly, also if both happened within one control step.");
  v("latch", c.latch,
    "Report what happened at any time in the control step: found_any, force_peak, dist_at_peak, "
    "pos_at_peak, first_touch_time.");
  v("friction_split", c.friction_split, "Add the fields normal_force and friction_force.");
  v("other_ids", c.other_ids, "Add the fields other_geom and other_body.");
  v("debug", c.debug, "Print the matched names.");
  v("debug_vis", c.debug_vis,
    "Include this sensor when ``Simulation.draw(scene)`` is called without a list of sensors.");
  v("viz", c.viz, "Appearance of the debug drawing.");
}

// Fields (float32 unless noted; B worlds, P primaries, K slots, N = P K with index p K + k, S
// secondaries, H history). A slot without a contact is all zero.
//   found      [B, N]     number of matching contacts, the same in every filled slot of a primary;
//                         contacts in the gap count, with zero force
//   force      [B, N, 3]  N, see above          torque  [B, N, 3]  N m, same axes
//   dist       [B, N]     m, negative in penetration; 0 with netforce
//   pos        [B, N, 3]  m, world              normal, tangent  [B, N, 3]  unit, world
//   X_history  [B, N, H(, 3)]  of every field X above, newest first, one entry per substep
//   current_air_time, last_air_time, current_contact_time, last_contact_time  [B, P]  s
//   touchdown, liftoff  bool [B, P]  a contact began (ended) in this control step; a contact that
//                         exists at the first substep after a reset has not begun then
//   found_any  bool [B, P]  any contact in this control step
//   force_peak [B, P, 3], dist_at_peak [B, P], pos_at_peak [B, P, 3]  the strongest of the step
//   first_touch_time [B, P]  s from the start of the control step to its first substep with
//                         contact; -1 if none
//   normal_force, friction_force  [B, N, 3]  N, axes of force, which is their sum
//   other_geom, other_body  int32 [B, N]  MuJoCo ids of the other side; -1: empty slot or a flex;
//                         with netforce those of the strongest contact
//   pair_found [B, P, S], pair_force [B, P, S, 3]  N, world, primary on secondary (policy each)
class ContactSensor : public Sensor {
 public:
  explicit ContactSensor(ContactSensorCfg cfg);
  ~ContactSensor() override;

  std::string_view kind() const override { return "contact"; }
  void edit_spec(mjSpec* spec) override;
  std::vector<std::unique_ptr<Sensor>> parts() override;
  void initialize(const SensorInit& init) override;
  bool wants_substep() const override;
  // Existence, position and depth of contacts follow from positions. Forces, and an order or a sum
  // by force, need the solver.
  mjtStage needs() const override;
  void substep(const World& world) override;
  void compute(const World& world) override;
  void reset(const World& world) override;
  bool debug_vis() const override { return cfg_.debug_vis; }
  void draw(const World& world, DebugShapes& shapes) override;

  const ContactSensorCfg& cfg() const { return cfg_; }
  // Local names of the primaries (secondaries), in the order of P (S). Valid after edit_spec() or
  // initialize().
  const std::vector<std::string>& primary_names() const { return primary_names_; }
  const std::vector<std::string>& secondary_names() const { return secondary_names_; }

  // bool [B, P]: the current contact (air) phase began less than dt + abs_tol ago. A contact that
  // begins and ends within a control step is not reported; `touchdown` reports it. Throws
  // RuntimeError without track_air_time.
  [[nodiscard]] Array compute_first_contact(double dt, double abs_tol = 1e-6) const;
  [[nodiscard]] Array compute_first_air(double dt, double abs_tol = 1e-6) const;

  // One slot as in MuJoCo's own sensor: in the contact frame, whatever the configuration. Valid
  // after compute(). Returns the number of matching contacts, 0 if the slot is empty.
  [[nodiscard]] int read_slot(const World& world, int primary, int slot,
                              ContactReading& reading) const;

 private:
  struct Output;
  Array first(double dt, double abs_tol, std::string_view field) const;
  void add_outputs(const SensorInit& init);
  void write_rows(const World& world);
  void clear_rows(int world, int primary, int first_slot);
  void write_slot(int world, int slot, int found, const ContactReading& reading);
  void remember(const World& world);
  void write_history(int world);
  void shift_history(int world, int begin, int end);

  ContactSensorCfg cfg_;
  std::vector<std::string> primary_names_, secondary_names_;
  std::shared_ptr<ContactPass> pass_;
  ContactReducer reducer_;
  ContactMemory memory_;
  std::vector<Output> outputs_;
  Rows<std::int32_t> other_geom_, other_body_;
  Rows<float> pair_found_, pair_force_;
  bool needs_wrench_ = false;
  std::vector<std::uint64_t> written_moment_;  // [B] of the rows
  std::vector<int> written_;                   // [B, P] primaries whose rows are not zero
  std::vector<int> num_written_;               // [B] number of those primaries
  std::vector<std::uint16_t> history_left_;    // [B, N] substeps until a slot's history is all zero
};

}  // namespace mjsense::sensors
