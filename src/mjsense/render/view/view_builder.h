// SPDX-License-Identifier: Apache-2.0
#pragma once
// Converts a world to a camera's frame: visible geoms, nearest first, with their materials and
// lights.

#include <mujoco/mujoco.h>

#include <memory>
#include <span>
#include <vector>

#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/light_space.h"
#include "mjsense/render/view/markers.h"
#include "mjsense/render/view/physical_light.h"
#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/view.h"

namespace mjsense::rays {
class RayWorld;
struct RayGeom;
struct SharedGeometry;
}  // namespace mjsense::rays

namespace mjsense::render {

struct ViewOptions {
  unsigned groups = 0x7;  // bit g: geoms of group g
  bool textures = true;
  bool shadows = false;
  int shadow_samples = 1;  // lights that are drawn for a light with a radius
  bool reflections = false;
  bool layered = false;  // View::layered
  float near = 0, far = 0;
  std::size_t markers = 0;       // maximum number of markers
  bool disable_culling = false;  // disables culling, for tests
  // The light model, the textures of planes and the skybox are mujoco_warp's. For an Appearance and
  // SurfaceAssets that are made so, too.
  bool as_mujoco_warp = false;
  bool warp_skybox = false;  // with as_mujoco_warp: a skybox, which hides no geoms
  PhysicalOptions physical;
};

// A geom with everything that its image depends on; used where the geoms do not come from a RayWorld.
struct DrawnGeom {
  rays::RayGeom shape;  // `center` and `half` are set
  float rgba[4];
  Material material;
  const Texture* texture;                // null: none
  const Texture* maps[kNumTextureMaps];  // null: none
  int object_id, object_type;            // for segmentation
  bool casts_shadows;
  const MeshSurface* mesh;       // null unless the shape has triangles
  MeshOnDemand* mesh_on_demand;  // as in ViewGeom
  void* bvh;
  const rays::Clusters* clusters;
  const rays::Horizons* horizons;
  const rays::HeightField* height_field;
};

struct DrawnScene {
  std::span<const DrawnGeom> geoms;
  std::span<const ViewLight> lights;  // poses in the world frame
  float near, far;                    // m
  bool shadows, reflections;
  const Texture* skybox;  // null: none
  Sky sky;
  bool haze;
  Fog fog;
  // 2D textures are projected along z onto all shapes, except onto triangles with texture coordinates,
  // where they are not repeated, as MuJoCo did before 3.12.
  bool projected_textures;
  // As in MuJoCo before 3.13: with texuniform, textures of flexes and skins are repeated by their
  // geom's size; the texture of a skin without coordinates is projected along z of the world, instead
  // of showing one point of it.
  bool sized_soft_textures;
  const PhysicalOptions* physical;  // null: classic
  // By light, for physically based shading: candela or lux (0: not set), m.
  std::span<const float> intensities, ranges;
  Rgb64 environment_tint{1, 1, 1};  // environment_factors() of the image light
};

// Computes Surface::highlight_threshold: the value below which the kernels' power() returns 0, with a margin for
// rounding. power() returns 0 for x below 0.3 if the exponent is at least 4, and where x^exponent
// is below e^-32.3.
float highlight_threshold_of(float exponent);

// Owns the geoms of one view. build() updates it and allocates nothing.
class ViewBuilder {
 public:
  ViewBuilder(const mjModel* model, const SurfaceAssets& assets, const ViewOptions& options);

  // position, rotation: X_WC, row-major.
  const View& build(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                    const Appearance& appearance, std::span<const Marker> markers,
                    const double position[3], const double rotation[9], const PixelGrid& grid);

  // For scenes of at most `geoms` geoms and `lights` lights.
  ViewBuilder(std::size_t geoms, std::size_t lights);
  const View& build(const DrawnScene& scene, const double position[3], const double rotation[9],
                    const PixelGrid& grid);

  const View& view() const { return view_; }
  void use_fixed(const FixedTile* tiles) {
    view_.fixed_tiles = tiles;
  }  // tiles of the last view built
  // Without markers.
  static std::size_t max_geoms(const mjModel* model) {
    return static_cast<std::size_t>(model->ngeom + model->nskin) + rays::flex_parts(model).size();
  }

 private:
  struct Order {
    int rank;  // 0 opaque, 1 transparent, 2 only casts shadows
    float key;
    int index;
  };
  void place(const rays::RayGeom& source, const double position[3], const double rotation[9],
             ViewGeom& g) const;
  void set_shape(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                 const rays::RayGeom& source, ViewGeom& g);
  // Ids of markers follow those of all other objects.
  int first_marker() const { return static_cast<int>(unsorted_.size() - options_.markers); }
  const MeshSurface* soft_surface(int index, const MeshSurface& shared, const float* normals,
                                  const float* positions, const int* faces);
  void set_surface(const rays::RayGeom& source, const float* rgba, const Material* material,
                   const Texture* texture, const Texture* const* maps, ViewGeom& g) const;
  // Sets the maps of a physically based view, and the factors that are 1 because of them.
  void set_maps(const Material& material, const Texture* const* maps, Surface& s) const;
  // shape(g) sets the fields that depend on the kind of object and returns the texture of its colours.
  // `maps`: those of the geom, otherwise of `assets_`.
  template <class SetShape>
  void add_shape(const rays::RayGeom& source, int id, const float* rgba, const Material* material,
                 const double position[3], const double rotation[9], SetShape shape,
                 const Texture* const* maps = nullptr);
  void sort_geoms(const double rotation[9]);
  void set_occluders();
  // Whether the geom ends the search for the mirror. If it reflects, build(p, r) must return the
  // view from the mirrored camera pose.
  template <class Build>
  bool ends_mirror_search(const rays::RayGeom& geom, int id, float alpha, float reflectance,
                          const double position[3], const double rotation[9], Build build);
  void set_mirror(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                  const Appearance& appearance, std::span<const Marker> markers,
                  const double position[3], const double rotation[9]);
  float sky_min_depth(const Sky& sky) const;
  float shown(float color) const;
  void set_sky(const rays::RayGeom* plane, const Sky& sky, const double position[3],
               const double rotation[9]);
  void set_lights(const rays::RayWorld& world, const Appearance& appearance,
                  const double position[3], const double rotation[9]);
  static void place_light(const double light_position[3], const double direction[3],
                          const double position[3], const double rotation[9], ViewLight& light);

  const SurfaceAssets* assets_ = nullptr;
  ViewOptions options_;
  View view_;
  std::vector<ViewGeom> unsorted_, sorted_;
  std::vector<Order> order_;
  std::vector<std::uint64_t> candidates_;  // bit per object that may be visible
  LightSpace light_space_;
  std::vector<float> occluder_boxes_;
  std::vector<std::uint8_t> fixed_;  // per geom; empty if not layered
  std::vector<int> geom_index_;
  // By flex part, then by skin, with the world's normals.
  std::vector<MeshSurface> soft_surfaces_;
  bool projected_ = false;                 // DrawnScene::projected_textures
  bool sized_soft_ = false;                // DrawnScene::sized_soft_textures
  std::unique_ptr<ViewBuilder> mirrored_;  // null: nothing can reflect
  int excluded_geom_ = -1;                 // geom that is not shown: the mirror itself
  bool own_headlight_ = true;  // otherwise headlight_, the viewing direction of the real camera
  double headlight_[3] = {};
  float tint_ = 1;  // factor of every colour: the mirror's reflectance
};

}  // namespace mjsense::render
