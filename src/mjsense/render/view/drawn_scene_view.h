// SPDX-License-Identifier: Apache-2.0
#pragma once
// Converts a DrawnScene to a camera's frame, as ViewBuilder converts a world.

#include <cstddef>
#include <memory>

#include "mjsense/render/view/drawn_scene.h"
#include "mjsense/render/view/geom_surface.h"
#include "mjsense/render/view/light_space.h"
#include "mjsense/render/view/view.h"
#include "mjsense/render/view/view_geoms.h"

namespace mjsense::render {

// Owns the geoms of one view.
class DrawnSceneView {
 public:
  // For scenes of at most `geoms` geoms and `lights` lights.
  DrawnSceneView(std::size_t geoms, std::size_t lights);

  // position, rotation: X_WC, row-major.
  const View& build(const DrawnScene& scene, const double position[3], const double rotation[9],
                    const PixelGrid& grid);

 private:
  void add(const DrawnGeom& geom, int id, const double position[3], const double rotation[9]);
  void set_mirror(const DrawnScene& scene, const double position[3], const double rotation[9]);

  View view_;
  SurfaceStyle style_;
  ViewGeoms geoms_;
  LightSpace light_space_;
  std::unique_ptr<DrawnSceneView> mirrored_;  // null until an image has reflections
  int excluded_geom_ = -1;                    // geom that is not shown: the mirror itself
};

}  // namespace mjsense::render
