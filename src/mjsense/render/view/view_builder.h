// SPDX-License-Identifier: Apache-2.0
#pragma once
// Converts a world to a camera's frame: visible geoms, nearest first, with their materials and
// lights.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/geom_surface.h"
#include "mjsense/render/view/light_space.h"
#include "mjsense/render/view/markers.h"
#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/view.h"
#include "mjsense/render/view/view_geoms.h"
#include "mjsense/render/view/view_options.h"

namespace mjsense::rays {
class RayWorld;
struct RayGeom;
struct SharedGeometry;
}  // namespace mjsense::rays

namespace mjsense::render {

// Owns the geoms of one view. build() updates it and allocates nothing.
class ViewBuilder {
 public:
  ViewBuilder(const mjModel* model, const SurfaceAssets& assets, const ViewOptions& options);

  // position, rotation: X_WC, row-major.
  const View& build(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                    const Appearance& appearance, std::span<const Marker> markers,
                    const double position[3], const double rotation[9], const PixelGrid& grid);

  const View& view() const { return view_; }
  void use_fixed(const FixedTile* tiles) {
    view_.fixed_tiles = tiles;
  }  // tiles of the last view built
  // Without markers.
  static std::size_t max_geoms(const mjModel* model) {
    return static_cast<std::size_t>(model->ngeom + model->nskin) + rays::flex_parts(model).size();
  }

 private:
  // What build() reads.
  struct Source {
    const rays::RayWorld& world;
    const rays::SharedGeometry& shapes;
    const Appearance& appearance;
    std::span<const Marker> markers;
    const double *position, *rotation;
  };
  void add(const Source& from, const rays::RayGeom& geom, int id, std::uint32_t flags,
           int material);
  void add_geoms(const Source& from);
  void add_soft_geoms(const Source& from);
  void add_markers(const Source& from);
  const Texture* texture_of(const Material& material) const;
  void set_shape(const Source& from, const rays::RayGeom& geom, ViewGeom& g);
  const MeshSurface* soft_surface(int index, const MeshSurface& shared, const float* normals,
                                  const float* positions, const int* faces);
  void set_mirror(const Source& from);
  // Ids of markers follow those of all other objects.
  int first_marker() const { return static_cast<int>(geoms_.capacity() - options_.markers); }

  const SurfaceAssets* assets_;
  ViewOptions options_;
  SurfaceStyle style_;
  View view_;
  ViewGeoms geoms_;
  std::vector<std::uint64_t> candidates_;  // bit per object that may be visible
  LightSpace light_space_;
  std::vector<std::uint8_t> fixed_;  // per geom; empty if not layered
  std::vector<int> geom_index_;
  // By flex part, then by skin, with the world's normals.
  std::vector<MeshSurface> soft_surfaces_;
  const rays::RayGeom* endless_ = nullptr;  // the first infinite plane
  std::unique_ptr<ViewBuilder> mirrored_;   // null: nothing can reflect
  int excluded_geom_ = -1;                  // geom that is not shown: the mirror itself
  // Whether the headlight shines in the camera's viewing direction. Otherwise headlight_, the viewing
  // direction of the real camera.
  bool own_headlight_ = true;
  double headlight_[3] = {};
};

}  // namespace mjsense::render
