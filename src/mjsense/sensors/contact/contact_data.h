// SPDX-License-Identifier: Apache-2.0
#pragma once
// Declares the fields of a contact sensor.

#include "mjsense/core/fields/data_class.h"

namespace mjsense::sensors {

// clang-format off
inline constexpr DataField kContactDataFields[] = {
  {"found", DType::kFloat32, "B, N", "", "Number of matching contacts, the same in every filled slot of a primary; contacts in the gap count, with zero force; 0: none."},
  {"force", DType::kFloat32, "B, N, 3", "N", "Force of the primary on the other side. Contact frame (x = normal, force[0] >= 0 without adhesion); world frame with global_frame or netforce."},
  {"torque", DType::kFloat32, "B, N, 3", "N m", "Torque of the primary on the other side, in the frame of force."},
  {"dist", DType::kFloat32, "B, N", "m", "Signed distance, negative in penetration; 0 with netforce."},
  {"pos", DType::kFloat32, "B, N, 3", "m", "Contact point, world."},
  {"normal", DType::kFloat32, "B, N, 3", "", "Unit normal, from the primary outwards, world."},
  {"tangent", DType::kFloat32, "B, N, 3", "", "Unit vector of the contact frame's y axis, world."},
  {"current_air_time", DType::kFloat32, "B, P", "s", "Time since the contact was lost; 0 in contact."},
  {"last_air_time", DType::kFloat32, "B, P", "s", "Length of the last phase in the air, the landing substep included."},
  {"current_contact_time", DType::kFloat32, "B, P", "s", "Time since the contact began; 0 in the air."},
  {"last_contact_time", DType::kFloat32, "B, P", "s", "Length of the last contact, the take-off substep included."},
  {"force_history", DType::kFloat32, "B, N, H, 3", "N", "The last substeps of force, newest first."},
  {"torque_history", DType::kFloat32, "B, N, H, 3", "N m", "The last substeps of torque, newest first."},
  {"dist_history", DType::kFloat32, "B, N, H", "m", "The last substeps of dist, newest first."},
  {"found_history", DType::kFloat32, "B, N, H", "", "The last substeps of found, newest first."},
  {"pos_history", DType::kFloat32, "B, N, H, 3", "m", "The last substeps of pos, newest first."},
  {"normal_history", DType::kFloat32, "B, N, H, 3", "", "The last substeps of normal, newest first."},
  {"tangent_history", DType::kFloat32, "B, N, H, 3", "", "The last substeps of tangent, newest first."},
  {"touchdown", DType::kBool, "B, P", "", "A contact began in this control step."},
  {"liftoff", DType::kBool, "B, P", "", "A contact ended in this control step."},
  {"found_any", DType::kBool, "B, P", "", "There was a contact in this control step."},
  {"force_peak", DType::kFloat32, "B, P, 3", "N", "Strongest force of this control step."},
  {"dist_at_peak", DType::kFloat32, "B, P", "m", "Signed distance at the strongest force."},
  {"pos_at_peak", DType::kFloat32, "B, P, 3", "m", "Contact point of the strongest force, world."},
  {"first_touch_time", DType::kFloat32, "B, P", "s", "From the start of the control step to its first substep with contact; -1: none."},
  {"normal_force", DType::kFloat32, "B, N, 3", "N", "Part of force along the normal."},
  {"friction_force", DType::kFloat32, "B, N, 3", "N", "The rest of force, along the tangents."},
  {"other_geom", DType::kInt32, "B, N", "", "MuJoCo geom id of the other side; -1: an empty slot or a flex; with netforce of the strongest contact."},
  {"other_body", DType::kInt32, "B, N", "", "MuJoCo body id of the other side; -1 as for other_geom."},
  {"pair_found", DType::kFloat32, "B, P, S", "", "With secondary_policy \"each\": number of contacts of primary and secondary."},
  {"pair_force", DType::kFloat32, "B, P, S, 3", "N", "Net force of the primary on the secondary, world."},
};
// clang-format on

inline constexpr DataClass kContactData{
    "ContactData",
    "Contacts of ``P`` primaries with ``S`` slots each; column ``p * S + s``, ``N = P * S``. A "
    "slot "
    "without contact is zero.\n\nForce is what the primary exerts on the secondary; normals point "
    "from the primary to the secondary.",
    kContactDataFields};

}  // namespace mjsense::sensors
