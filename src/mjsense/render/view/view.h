// SPDX-License-Identifier: Apache-2.0
#pragma once
// One image about to be rendered: everything it can show, in the camera's frame (x right, y up,
// looking along -z), where rays start at the origin and single precision is enough. Plain
// structures, because kernels of every instruction set read them.

#include <cstddef>
#include <cstdint>

#include "mjsense/render/view/surface_assets.h"

namespace mjsense {

struct Clusters;
struct HeightField;
class Horizons;

// Rays of pixels. Pixel (x, y), row 0 at the top, sees along (X, Y, -1) from the origin, with X =
// left + dx (x + 0.5) and Y = top + dy (y + 0.5); an orthographic one along (0, 0, -1) from (X, Y,
// 0). A parameter t of such a ray is planar depth.
struct PixelGrid {
  int width = 0, height = 0;
  float left = 0, top = 0, dx = 0, dy = 0;
  bool orthographic = false;
  const float* bent =
      nullptr;  // [H, W, 2] X and Y of a lens with distortion; null: the formula above
};

// How a geom answers light. MuJoCo's classic material.
struct Surface {
  float rgba[4];
  float specular, exponent, emission;  // exponent: 128 * shininess
  float dull;                          // (N H)^2 below which highlights are 0, or -1
  const Texture* texture;              // null: none
  float repeat[2], shift[2];           // 2D: texture coordinates times repeat plus shift
  float stretch[3];                    // cube: times the direction
  bool mapped;                         // 2D texture by the mesh's own coordinates
  bool from_above;                     // 2D texture laid along z on a mesh or height field
};

struct alignas(64) ViewGeom {
  float rot[9];     // R_CG row-major
  float pos[3];     // p_CG, m
  float eye[3];     // the camera in the geom's frame: -R_CG^T p_CG, m
  float size[3];    // as mjModel's geom_size, m
  float box[6];     // local bounding box: centre, half sizes; m
  float center[3];  // bounding sphere in C, m; planes: endless
  float radius;
  float window[4];        // X min, X max, Y min, Y max of what it may cover
  float nearest;          // no point of it has less planar depth
  int type;               // mjtGeom; mjGEOM_MESH for a flex or skin
  int id;                 // of geoms, parts of flexes, skins: unique in the model
  int object_id, object;  // for segmentation: id and mjtObj
  bool fixed;             // belongs to View::fixed
  bool transparent;       // blended over what is behind it, casts shadows, receives none
  bool behind;  // a plane that the camera sees from below: a faint veil, and nothing to depth and
                // segmentation
  void* bvh;    // RTCScene of a mesh, a height field's surface, a flex, a skin; else null
  const Clusters* clusters;  // the same triangles to be drawn; null: rays only
  const Horizons* horizons;  // of its faces; null without clusters
  const MeshSurface* mesh;
  const HeightField* height_field;
  Surface surface;
};

enum class LightKind : std::uint8_t { kDirectional, kSpot, kPoint };

struct ViewLight {
  LightKind kind;
  bool shadows;
  float pos[3], dir[3];  // in C
  float ambient[3], diffuse[3], specular[3];
  float attenuation[3];
  float cos_cutoff, exponent;  // spot
};

// Where boxes lie as a light sees them: u and v within [u0, u1] and [v0, v1], not nearer than w. May
// be read kWindowPadding elements beyond the last.
struct LightWindows {
  float *u0, *u1, *v0, *v1, *w;
};
inline constexpr int kWindowPadding = 16;

// Of positions, for their distance: so much rays and the tests of what they hit may round.
inline constexpr float kLightError = 1e-5f;

// The image of a light: of a point at q from its origin u, v and w are the components along its axes;
// w leads away from the light. In perspective u and v are divided by w.
struct LightFrame {
  float origin[3], axes[3][3];  // C, m; the origin of a directional light is the camera's
  bool perspective;
  float limit;  // it shines on no point with larger |u| or |v|
  LightWindows
      windows;  // of the view's geoms; of planes, and of what reaches behind the light: endless
};

// One, or for a light that shines to all sides six, towards +x -x +y -y +z -z. None: no shadows.
struct LightFrames {
  const LightFrame* first = nullptr;
  int count = 0;
};

// The sides of geoms' bounding boxes that face a light, at most one of each opposite pair: what lies
// beyond, normal . x > offset (m, with room for rounding), the geom leaves to the light. Others, and planes,
// have an endless offset. May be read as LightWindows.
struct LightSides {
  float* normal[3][3];
  float* offset[3];
};

struct FixedTile;

struct View {
  static constexpr int kMaxLights = 32;
  PixelGrid grid;
  float near = 0, far = 0;  // planar m
  const ViewGeom* geoms = nullptr;
  int num_geoms = 0;        // the first num_opaque are opaque and in sight, nearest first;
  int num_opaque = 0;       // then num_transparent in sight, by MuJoCo's order of blending;
  int num_transparent = 0;  // the rest only casts shadows
  ViewLight lights[kMaxLights];
  LightFrames light_frames[kMaxLights];
  LightSides light_sides[kMaxLights];  // of those that have frames
  int num_lights = 0;
  bool shadows = false;
  // Fixed geoms are drawn first, for themselves. `fixed`: the image's tiles of them, row by row, if
  // they are known.
  bool layered = false;
  const FixedTile* fixed = nullptr;
  const int* index_of_id = nullptr;  // of geoms in sight, in `geoms`
  float global_ambient = 0;
  const Texture* skybox = nullptr;
  float r_wc[9] = {};      // for the skybox
  float sky_distance = 0;  // m; it hides what is farther away. 0: hides nothing
  struct Haze {            // over an endless plane
    float up[3];           // the plane's normal, in C
    float height = 0;      // of the camera over the plane, m; not positive: no haze
    float width;           // of sky_distance
    float rgb[3];
  } haze;
  float sky_from = 0;  // planar m: what is nearer is neither hidden nor hazy
  // The first geom that reflects, in sight or not: -1 if there is none. What it shows is the scene
  // as a camera behind it sees it through it, added to its own colour.
  int mirror = -1;  // geom id
  const View* reflection = nullptr;
};

// Where the image goes; null: not wanted. Whole images, rows from the top.
struct ImageTargets {
  std::uint8_t* rgb = nullptr;           // [H, W, 3]
  float* depth = nullptr;                // [H, W]
  std::int32_t* segmentation = nullptr;  // [H, W, 2]
  float* normals = nullptr;              // [H, W, 3]
  float* points = nullptr;               // [H, W, 3]
  bool ray_depth = false;                // depth along the ray instead of planar
  int samples = 1;                       // of rgb
  FixedTile* fixed = nullptr;            // these are made, and no image
};

inline constexpr int kTileSize = 16;  // pixels; a tile is 4 x 4 packets of 4 x 4 pixels

// What a tile shows of the fixed geoms: Hits by packet, the lanes of each packet that a light does
// not reach, because a fixed geom stands in its way or the surface is turned away, and the colours
// where nothing else casts a shadow.
struct alignas(64) FixedTile {
  static constexpr int kPixels = kTileSize * kTileSize;
  float t[kPixels], u[kPixels], v[kPixels], n[3][kPixels];
  int id[kPixels], prim[kPixels];
  float rgb[3][kPixels];
  std::uint16_t dark[View::kMaxLights][kPixels / 16];
};

// Work space of one thread: lists as long as the view has geoms.
struct TileScratch {
  int* row = nullptr;  // geoms in sight of the row of tiles
  int row_count = 0;
  int* opaque = nullptr;  // geoms in sight of the tile
  int* transparent = nullptr;
  int* casters = nullptr;  // of all lights: kMaxLights times as long, and what is spare
  LightWindows windows{};  // of casters
  int spare_casters = 0;   // for parts of geoms
  void* tile = nullptr;    // a TileSpace of the kernels
};

// Bytes of a TileSpace, 64-byte aligned.
std::size_t tile_bytes();

// Renders rows of tiles [first, last) of the image. Every pixel is a function of the view alone.
using RenderTiles = void (*)(const View& view, const ImageTargets& targets, int first, int last,
                             TileScratch& scratch);
void render_tiles_portable(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx2(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx512(const View&, const ImageTargets&, int first, int last, TileScratch&);

// The fastest that this CPU runs.
RenderTiles best_render_tiles();

}  // namespace mjsense
