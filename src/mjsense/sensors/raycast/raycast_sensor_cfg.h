// SPDX-License-Identifier: Apache-2.0
#pragma once
// RayCastSensor: distances, hit points and normals of rays that are attached to one or more frames.
//
// B worlds, F frames, n rays per frame, N = F * n rays (frame-major: ray f * n + i). Fields:
//   distances     float32 [B, N]     m along the ray; -1: nothing in [min_distance, max_distance]
//   hit_pos_w     float32 [B, N, 3]  m, world; the ray's origin if it hits nothing
//   normals_w     float32 [B, N, 3]  unit, world: outward, or by the triangle's winding; 0: no hit
//   frame_pos_w   float32 [B, F, 3]  m, world
//   frame_quat_w  float32 [B, F, 4]  wxyz, of the frame itself (not of the alignment); the largest
//                                    component is positive
//   pos_w         float32 [B, 3]     m, world, of frame 0
//   quat_w        float32 [B, 4]     wxyz, of frame 0
// and with hit_ids
//   geom_id       int32   [B, N]     -1: none; num_geoms + flex id for a flex
//   body_id       int32   [B, N]     body of that geom; -1: none, or a flex
//   material_id   int32   [B, N]     material of that geom; -1: none

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"
#include "mjsense/sensors/raycast/pattern.h"
#include "mjsense/sensors/raycast/ray_frame.h"

namespace mjsense::sensors {

struct RayCastVizCfg {
  bool show_rays = false;
  bool show_normals = false;
  std::array<float, 4> hit_color{0, 1, 1, 1};
  std::array<float, 4> ray_color{0, 1, 0, 0.8f};
  std::array<float, 4> miss_color{1, 0, 0, 0.4f};
  std::array<float, 4> normal_color{1, 1, 0, 1};
  double hit_radius = 0.5, ray_width = 0.1, normal_length = 5.0;
};
template <class V>
void visit_fields(V& v, RayCastVizCfg& c) {
  v.object("RayCastVizCfg",
           "The debug drawing of a ray sensor. Colours are rgba, sizes are in units of the model's "
           "``stat.meansize``.");
  v("show_rays", c.show_rays, "Draw arrows from the origins to the hits.");
  v("show_normals", c.show_normals, "Draw arrows along the surface normals at the hits.");
  v("hit_color", c.hit_color, "Colour of the spheres at the hits.").within(0, 1);
  v("ray_color", c.ray_color, "Colour of rays that hit.").within(0, 1);
  v("miss_color", c.miss_color, "Colour of rays that miss.").within(0, 1);
  v("normal_color", c.normal_color, "Colour of the normals.").within(0, 1);
  v("hit_radius", c.hit_radius, "Radius of the spheres.").at_least(0);
  v("ray_width", c.ray_width, "Width of the arrows.").at_least(0);
  v("normal_length", c.normal_length, "Length of the normals.").at_least(0);
}

struct RayCastSensorCfg : SensorCfg {
  std::vector<scene::ObjRef> frame;
  PatternCfg pattern = GridPattern{};
  NamedEnum<RayAlignment> ray_alignment;
  double max_distance = 10.0;
  bool exclude_parent_body = true;
  std::optional<std::vector<int>> include_geom_groups{{0, 1, 2}};
  bool debug_vis = false;
  RayCastVizCfg viz;

  // Beyond mjlab.
  double min_distance = 0.0;
  bool hit_ids = true;
  bool any_frame = false;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, RayCastSensorCfg& c) {
  v.object("RayCastSensorCfg",
           "Casts rays from frames against all visible geoms. ``data`` is a "
           ":class:`mjsense.sensors.RayCastData`.",
           "raycast");
  v.extends(static_cast<SensorCfg&>(c));
  v("frame", c.frame,
    "Bodies (their own frame, not the inertial one), sites or geoms from which the rays start.")
      .or_one();
  v("pattern", c.pattern, "The rays of one frame.");
  v("ray_alignment", c.ray_alignment,
    "base: offsets and directions rotate with the frame; yaw: only with its heading; world: not at "
    "all.");
  v("max_distance", c.max_distance, "Maximum distance; more distant hits are misses.")
      .unit("m")
      .positive()
      .may_be_infinite();
  v("exclude_parent_body", c.exclude_parent_body,
    "Ignore the body from which a ray starts (but not its children).");
  v("include_geom_groups", c.include_geom_groups, "Geom groups that rays can hit; None: all.")
      .within(0, 5);
  v("debug_vis", c.debug_vis,
    "Include this sensor when ``Simulation.draw(scene)`` is called without a list of sensors.");
  v("viz", c.viz, "Appearance of the debug drawing.");
  v("min_distance", c.min_distance,
    "Minimum distance; nearer hits are misses, and they hide what is behind them.")
      .unit("m")
      .at_least(0);
  v("hit_ids", c.hit_ids, "Add the fields geom_id, body_id and material_id of what was hit.");
  v("any_frame", c.any_frame, "Allow xbody and camera frames too, which mjlab refuses.");
}

}  // namespace mjsense::sensors
