// SPDX-License-Identifier: Apache-2.0
#pragma once
// Input of the render kernels for one image: everything it can show, in the camera's frame (x
// right, y up, looking along -z), where rays start at the origin and single precision is
// sufficient. Plain structures only, because kernels of every instruction set read them.

#include <cstddef>
#include <cstdint>

#include "mjsense/render/view/surface_assets.h"

namespace mjsense::rays {
class Horizons;
struct Clusters;
struct HeightField;
}  // namespace mjsense::rays

namespace mjsense::render {

// Rays of pixels. Pixel (x, y), row 0 at the top, has the ray from the origin along (X, Y, -1),
// with X = left + dx (x + 0.5) and Y = top + dy (y + 0.5). An orthographic camera's ray starts at
// (X, Y, 0) and goes along (0, 0, -1). The parameter t of such a ray is planar depth.
struct PixelGrid {
  int width = 0, height = 0;
  float left = 0, top = 0, dx = 0, dy = 0;
  bool orthographic = false;
  // [H, W, 2]: X and Y of each pixel for a lens with distortion; null: use the formula above.
  const float* distorted_rays = nullptr;

  bool operator==(const PixelGrid&) const = default;
};

// MuJoCo's classic material of a geom.
struct Surface {
  float rgba[4];
  float specular, exponent, emission;  // exponent: 128 * shininess
  float highlight_threshold;           // (N . H)^2 below which the highlight is 0, or -1
  const Texture* texture;              // null: no texture
  float repeat[2], shift[2];  // for 2D textures: coordinates are multiplied by repeat, then shifted
  float stretch[3];           // for cube maps: multiplies the direction
  bool mapped;                // 2D texture with the mesh's own coordinates
  bool from_above;            // 2D texture projected along z

  bool operator==(const Surface&) const = default;
};

// A mesh whose parts are built when a kernel first needs them. It belongs to one thread.
class MeshOnDemand {
 public:
  virtual bool has_coordinates() const = 0;  // texture coordinates
  virtual const rays::Clusters& clusters() = 0;
  virtual const rays::Horizons& horizons() = 0;
  virtual void* bvh() = 0;  // RTCScene
  virtual void* shadow_bvh() = 0;
  // Fills the geom's MeshSurface. `coordinates`: also uvs and density, if the mesh has them.
  virtual void prepare_surface(bool coordinates) = 0;

 protected:
  ~MeshOnDemand() = default;
};

struct alignas(64) ViewGeom {
  float rot[9];     // R_CG row-major
  float pos[3];     // p_CG, m
  float eye[3];     // camera position in the geom's frame: -R_CG^T p_CG, m
  float size[3];    // as mjModel's geom_size, m
  float box[6];     // local bounding box: centre, half sizes; m
  float center[3];  // centre of the bounding sphere in C, m; radius is infinite for planes
  float radius;
  float window[4];        // X min, X max, Y min, Y max of the pixels it may cover
  float nearest;          // lower bound of its planar depth
  int type;               // mjtGeom; mjGEOM_MESH for a flex or skin
  int id;                 // id among geoms, parts of flexes and skins, unique in the model
  int object_id, object;  // for segmentation: id and mjtObj
  bool fixed;             // belongs to the layer View::fixed
  bool casts = true;      // casts shadows
  bool transparent;       // blended over what is behind it; casts shadows and receives none
  // A plane seen from below: drawn as a faint veil, absent in depth and segmentation.
  bool behind;
  bool deforms;  // its triangles may change while this structure does not
  void* bvh;     // RTCScene of a mesh, a height field's surface, a flex or a skin; else null
  const rays::Clusters* clusters;  // the same triangles, for rasterising; null: use rays only
  const rays::Horizons* horizons;  // horizons of the mesh's faces; null without clusters
  const MeshSurface* mesh;
  // Not null: has what `bvh`, `clusters` and `horizons`, which are null, would point to, and fills
  // `mesh`.
  MeshOnDemand* on_demand;
  const rays::HeightField* height_field;
  Surface surface;

  bool operator==(const ViewGeom&) const = default;
};

enum class LightKind : std::uint8_t { kDirectional, kSpot, kPoint };

struct ViewLight {
  LightKind kind;
  bool shadows;
  float pos[3], dir[3];  // camera frame
  float ambient[3], diffuse[3], specular[3];
  float attenuation[3];
  float cos_cutoff, exponent;  // for spot lights
  // Square around the light's axis outside of which there are no shadows, as in MuJoCo's shadow map:
  // its axes (unit, camera frame), and half its side in m, or for spot lights relative to the
  // distance along the axis. Not positive: no limit.
  float square[2][3], square_limit;
  // With a limit: geoms cast no shadow where they are nearer to the light, along its axis, m.
  float shadow_near;

  bool operator==(const ViewLight&) const = default;
};

// Windows of boxes in a light's image: u and v are within [u0, u1] and [v0, v1], and w is at least
// w. Up to kWindowPadding elements past the end may be read.
struct LightWindows {
  float *u0, *u1, *v0, *v1, *w;
};
inline constexpr int kWindowPadding = 16;

// Position error relative to distance, for the rounding of rays and intersection tests.
inline constexpr float kLightError = 1e-5f;

// Image space of a light. u, v and w of a point are the components of its offset from the origin
// along the axes; w points away from the light. If `perspective`, u and v are divided by w.
struct LightFrame {
  float origin[3], axes[3][3];  // camera frame, m; directional lights: the camera's origin
  bool perspective;
  float limit;  // the light does not reach points with |u| or |v| above it
  // Windows of the view's geoms; infinite for planes and for geoms that reach behind the light.
  LightWindows windows;
};

// One frame, or six for a light that shines in all directions, towards +x -x +y -y +z -z. None if
// it casts no shadows.
struct LightFrames {
  const LightFrame* first = nullptr;
  int count = 0;
};

// The one of the light's frames that serves the points in a box.
const LightFrame& frame_towards(const LightFrames& frames, const float* low, const float* high);

// Sides of geoms' bounding boxes that face a light, at most one of each opposite pair. A geom does
// not shadow points beyond such a side, i.e. with normal . x > offset (m, including a margin for
// rounding). The offset is infinite for other sides and for planes. Padding as in LightWindows.
struct LightSides {
  float* normal[3][3];
  float* offset[3];
};

struct FixedTile;

// OpenGL's linear fog: its density is 0 at planar depth `start` and grows with `slope` (1/m) to 1.
struct Fog {
  float start = 0, slope = 0;  // slope 0: no fog
  float rgb[3] = {};

  bool operator==(const Fog&) const = default;
};

struct View {
  static constexpr int kMaxLights = 32;
  PixelGrid grid;
  float near = 0, far = 0;  // planar depth, m
  // Order: num_opaque visible opaque geoms, nearest first; then num_transparent visible transparent
  // ones, in MuJoCo's blending order; then geoms that only cast shadows.
  const ViewGeom* geoms = nullptr;
  int num_geoms = 0;
  int num_opaque = 0;
  int num_transparent = 0;
  ViewLight lights[kMaxLights];
  LightFrames light_frames[kMaxLights];
  LightSides light_sides[kMaxLights];  // for lights with frames
  int num_lights = 0;
  bool shadows = false;
  // Layered: fixed geoms are drawn first. `fixed`: the image's cached tiles of them, row by row;
  // null if there are none.
  bool layered = false;
  const FixedTile* fixed = nullptr;
  const int* index_of_id = nullptr;  // index in `geoms` by id, for visible geoms
  bool backs = false;                // depth and segmentation include planes seen from behind
  float global_ambient = 0;
  const Texture* skybox = nullptr;
  float r_wc[9] = {};      // for the skybox
  float sky_distance = 0;  // m; geoms farther away are hidden by it. 0: it hides nothing
  struct Haze {            // over an infinite plane
    float up[3] = {};      // normal of the plane, camera frame
    float height = 0;      // height of the camera above the plane, m; not positive: no haze
    float width = 0;       // relative to sky_distance
    float rgb[3] = {};

    bool operator==(const Haze&) const = default;
  } haze;
  float sky_from = 0;    // planar depth, m; nearer points are neither hidden nor hazy
  Fog fog;               // over surfaces, haze and skybox
  float sky_radius = 0;  // m; the skybox is as deep in the fog as a cylinder of this radius
  // The first geom that reflects, visible or not; -1 if there is none. The reflected view is that
  // of the camera mirrored in its plane; it is added to the geom's own colour.
  int mirror = -1;  // geom id
  const View* reflection = nullptr;
};

// Bounding box of points in the camera's frame, m. low > high: no points.
struct TileBox {
  float low[3] = {__builtin_inff(), __builtin_inff(), __builtin_inff()};
  float high[3] = {-__builtin_inff(), -__builtin_inff(), -__builtin_inff()};
};

// Output images, rows from the top; null: not requested.
struct ImageTargets {
  std::uint8_t* rgb = nullptr;           // [H, W, 3]
  float* depth = nullptr;                // [H, W]
  std::int32_t* segmentation = nullptr;  // [H, W, 2]
  float* normals = nullptr;              // [H, W, 3]
  float* points = nullptr;               // [H, W, 3]
  bool ray_depth = false;                // depth along the ray instead of planar depth
  int samples = 1;                       // samples per pixel, for rgb
  FixedTile* fixed = nullptr;            // not null: write these tiles and no image
  // As with multisampling in OpenGL, use the samples for edges only, and write rgb only. `samples`
  // must be a power of two up to kMostMultisamples.
  static constexpr int kMostMultisamples = 16;
  bool multisampled = false;
  // By tile, row by row; null: not used. Tiles whose `changed` is 0 are not written. The box of `lit`
  // grows to contain what the tile shows, if the view has shadows.
  const std::uint8_t* changed = nullptr;
  TileBox* lit = nullptr;
};

inline constexpr int kTileSize = 16;  // pixels; a tile is 4 x 4 packets of 4 x 4 pixels

// Cached layer of a tile: Hits by packet; per light, the lanes of each packet that it does not
// reach, because a fixed geom shadows them or they face away; and the colours where no other geom
// casts a shadow.
struct alignas(64) FixedTile {
  static constexpr int kPixels = kTileSize * kTileSize;
  float t[kPixels], u[kPixels], v[kPixels], n[3][kPixels];
  int id[kPixels], prim[kPixels];
  float rgb[3][kPixels];
  std::uint16_t dark[View::kMaxLights][kPixels / 16];
};

// Work space of one thread. The lists have one entry per geom of the view.
struct TileScratch {
  int* row = nullptr;  // geoms visible in the row of tiles
  int row_count = 0;
  int* opaque = nullptr;  // geoms visible in the tile
  int* transparent = nullptr;
  int* casters = nullptr;  // for all lights: kMaxLights entries per geom, plus spare_casters
  LightWindows windows{};  // windows of the casters
  int spare_casters = 0;   // entries for parts of geoms
  void* tile = nullptr;    // TileSpace of the kernels
};

// Size of a TileSpace; it must be aligned to 64 bytes.
std::size_t tile_bytes();

// Renders the rows of tiles [first, last) of the image. Every pixel depends on the view only.
using RenderTiles = void (*)(const View& view, const ImageTargets& targets, int first, int last,
                             TileScratch& scratch);
void render_tiles_portable(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx2(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx512(const View&, const ImageTargets&, int first, int last, TileScratch&);

// Whether a tile within `window` may show the geom. Not for transparent geoms, height fields and
// orthographic cameras. `window`: as ViewGeom::window.
using MayShow = bool (*)(const ViewGeom& geom, const float* window);
bool may_show_portable(const ViewGeom&, const float* window);
bool may_show_avx2(const ViewGeom&, const float* window);
bool may_show_avx512(const ViewGeom&, const float* window);

// The fastest versions that this CPU supports.
RenderTiles best_render_tiles();
MayShow best_may_show();

}  // namespace mjsense::render
