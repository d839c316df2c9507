// SPDX-License-Identifier: Apache-2.0
#pragma once
// Gathers the surfaces that a packet's pixels show: points, normals, materials, texture colours.
// Part of the tile kernels.

#include "mjsense/render/kernels/mesh_parts.h"
#include "mjsense/render/kernels/texture.h"

namespace mjsense::render {
namespace {

// Surface data of a packet, camera frame. Undefined in lanes without a hit.
struct alignas(64) Surfaces {
  float p[3][kLanes], n[3][kLanes];
  float rgb[3][kLanes], alpha[kLanes];
  float texture[3][kLanes];  // 0..1; linear in physically based views
  float specular[kLanes], exponent[kLanes], highlight_threshold[kLanes], emission[kLanes];
  // For physically based views, where `rgb` is linear, and `specular` is the F0 of dielectrics.
  float roughness[kLanes], metallic[kLanes];
  float occlusion[kLanes];  // share of the light from the surroundings that reaches the surface
  float glow[3][kLanes];    // emission, as a colour
};

// Normal of a primitive at the surface point p, geom frame, any length.
inline Vec3f primitive_normal(const ViewGeom& g, Vec3f p) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  switch (g.type) {
    case mjGEOM_SPHERE:
      return {p.x, p.y, p.z};
    case mjGEOM_ELLIPSOID:
      return {p.x * splat(1 / (g.size[0] * g.size[0])), p.y * splat(1 / (g.size[1] * g.size[1])),
              p.z * splat(1 / (g.size[2] * g.size[2]))};
    case mjGEOM_CAPSULE: {
      const Float h = splat(g.size[1]);
      return {p.x, p.y, p.z - min(max(p.z, -h), h)};
    }
    case mjGEOM_CYLINDER: {
      const Float ring = sqrt(fma(p.x, p.x, p.y * p.y)) * splat(1 / g.size[0]);
      const Mask end = abs(p.z) * splat(1 / g.size[1]) > ring;
      return {select(end, zero, p.x), select(end, zero, p.y),
              select(end, select(p.z < zero, -one, one), zero)};
    }
    case mjGEOM_BOX: {
      const Float x = p.x * splat(1 / g.size[0]), y = p.y * splat(1 / g.size[1]),
                  z = p.z * splat(1 / g.size[2]);
      const Float ax = abs(x), ay = abs(y), az = abs(z);
      const Mask is_x = (ax >= ay) & (ax >= az), not_z = is_x | (ay >= az);
      return {select(is_x, x, zero), select(is_x, zero, select(not_z, y, zero)),
              select(not_z, zero, z)};
    }
    default:
      return {zero, zero, one};
  }
}

// Displacement of the hit point on its tangent plane from one pixel to the next, horizontally and
// vertically; geom frame, m.
struct Steps {
  Vec3f x, y;
};

inline Steps pixel_steps(const View& view, const ViewGeom& g, const Pixels& pixels,
                         const Hits& hits, int k, Vec3f n) {
  const bool ortho = view.grid.orthographic;
  const Float zero = splat(0.0f), one = splat(1.0f);
  const Vec3f d{ortho ? zero : load(pixels.x + k), ortho ? zero : load(pixels.y + k), splat(-1.0f)};
  if (g.shows_back) n = {-n.x, -n.y, -n.z};
  const Float inverse = one / min(dot(n, d), splat(-1e-4f));
  const Float scale = ortho ? one : load(hits.t + k);
  const auto step = [&](Float along_n, Float ex, Float ey, float size) {
    const Float slope = along_n * inverse, s = scale * splat(size);
    return to_geom(g.rot, {s * (ex - d.x * slope), s * (ey - d.y * slope), s * slope});
  };
  return {step(n.x, one, zero, view.grid.dx), step(n.y, zero, one, view.grid.dy)};
}

inline Vec3f load3(const float (*p)[kLanes], int k) {
  return {load(p[0] + k), load(p[1] + k), load(p[2] + k)};
}

// What scalar code computes for each lane: the normals of a mesh's faces, and texture coordinates on
// meshes and curved primitives.
struct alignas(64) Mapped {
  float n[3][kLanes];  // unit, geom frame
  float u[kLanes], v[kLanes];
  float du[3][kLanes], dv[3][kLanes];  // LaneCoordinates

  void set_normal(int lane, const float* from) {
    for (int k = 0; k < 3; ++k) n[k][lane] = from[k];
  }
  void set(int lane, const LaneCoordinates& at) {
    u[lane] = at.u;
    v[lane] = at.v;
    for (int k = 0; k < 3; ++k) {
      du[k][lane] = at.du[k];
      dv[k][lane] = at.dv[k];
    }
  }
  Coordinates coordinates(int k) const {
    return {load(u + k), load(v + k), load3(du, k), load3(dv, k)};
  }
};

// The plane of a triangle: its unit normal, and the gradients of the barycentric coordinates of its
// second and third corner.
struct FacePlane {
  float n[3], second[3], third[3];

  FacePlane(const MeshSurface& mesh, int face) {
    const int* corners = mesh.faces + 3 * face;
    const float* p[3];
    for (int i = 0; i < 3; ++i) p[i] = mesh.positions + 3 * corners[i];
    float a[3], b[3];
    for (int k = 0; k < 3; ++k) {
      a[k] = p[1][k] - p[0][k];
      b[k] = p[2][k] - p[0][k];
    }
    cross(a, b, n);
    const float square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    const float inverse = square > 0 ? 1 / square : 0, length = __builtin_sqrtf(inverse);
    cross(b, n, second);
    cross(n, a, third);
    for (int k = 0; k < 3; ++k) {
      second[k] *= inverse;
      third[k] *= inverse;
      n[k] *= length;
    }
  }

  static void cross(const float* a, const float* b, float* out) {
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      out[k] = a[i] * b[j] - a[j] * b[i];
    }
  }
};

inline void map_mesh(const ViewGeom& g, const Hits& hits, std::uint32_t lanes, Mapped& out) {
  const MeshSurface& mesh = *g.mesh;
  for (std::uint32_t todo = lanes; todo;) {
    const int face = hits.prim[__builtin_ctz(todo)];
    const FacePlane plane(mesh, face);
    LaneCoordinates at{};
    const float* uv = nullptr;
    if (g.surface.uses_mesh_uvs) {
      uv = mesh.uvs + 6 * face;
      for (int k = 0; k < 3; ++k) {
        at.du[k] = plane.second[k] * (uv[2] - uv[0]) + plane.third[k] * (uv[4] - uv[0]);
        at.dv[k] = plane.second[k] * (uv[3] - uv[1]) + plane.third[k] * (uv[5] - uv[1]);
      }
    }
    for (std::uint32_t rest = todo; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      if (hits.prim[i] != face) continue;
      todo &= ~(1u << i);
      out.set_normal(i, plane.n);
      if (!uv) continue;
      const float b1 = hits.u[i], b2 = hits.v[i], b0 = 1 - b1 - b2;
      at.u = b0 * uv[0] + b1 * uv[2] + b2 * uv[4];
      at.v = b0 * uv[1] + b1 * uv[3] + b2 * uv[5];
      out.set(i, at);
    }
  }
}

inline void map_curved(const ViewGeom& g, std::uint32_t lanes, const float (*local)[kLanes],
                       const float (*normal)[kLanes], Mapped& out) {
  for (; lanes; lanes &= lanes - 1) {
    const int i = __builtin_ctz(lanes);
    const float p[3] = {local[0][i], local[1][i], local[2][i]};
    const float n[3] = {normal[0][i], normal[1][i], normal[2][i]};
    out.set(i, curved_uv(g, p, n));
  }
}

// Changes the surfaces by the material's maps, in the lanes of `m`. read(texture) samples it; du, dv:
// gradients of its coordinates; n: the normal by which the surface is shaded, unit; geom frame.
template <class Read>
inline void apply_maps(const ViewGeom& g, Read read, Vec3f du, Vec3f dv, Vec3f n, int k, Mask m,
                       Surfaces& out) {
  const auto& maps = g.surface.maps;
  const Float scale = splat(1.0f / 255);
  const auto put = [&](float* to, Float x) { store(to + k, select(m, x, load(to + k))); };
  const auto multiply = [&](float* to, Float x) { put(to, load(to + k) * x * scale); };
  if (const Texture* map = maps[kOrmMap]) {
    const Rgb orm = read(*map);
    multiply(out.occlusion, orm.r);
    multiply(out.roughness, orm.g);
    multiply(out.metallic, orm.b);
  }
  if (const Texture* map = maps[kOcclusionMap]) multiply(out.occlusion, read(*map).r);
  if (const Texture* map = maps[kRoughnessMap]) multiply(out.roughness, read(*map).r);
  if (const Texture* map = maps[kMetallicMap]) multiply(out.metallic, read(*map).r);
  if (const Texture* map = maps[kOpacityMap]) multiply(out.alpha, read(*map).r);
  if (const Texture* map = maps[kEmissiveMap]) {
    const Rgb seen = read(*map);
    const Float rgb[3] = {seen.r * scale, seen.g * scale, seen.b * scale};
    for (int c = 0; c < 3; ++c)
      put(out.glow[c], load(out.emission + k) * (map->linear ? rgb[c] : srgb_to_linear(rgb[c])));
  }
  if (const Texture* map = maps[kNormalMap]) {
    const Rgb seen = read(*map);
    const auto part = [&](Float x) { return fma(x, splat(2.0f / 255), splat(-1.0f)); };
    // With w = n . (du x dv), the point moves by (dv x n) / w if u grows by 1 and v stays, and by
    // (n x du) / w if v grows.
    const Float w = dot(n, cross(du, dv));
    const auto along = [&](Vec3f d, Float much) -> Vec3f {
      const Float size = much / sqrt(max(dot(d, d), splat(1e-20f)));
      const Float turned = select(w < splat(0.0f), -size, size);
      return {d.x * turned, d.y * turned, d.z * turned};
    };
    const Vec3f right = along(cross(dv, n), part(seen.r)), up = along(cross(n, du), -part(seen.g));
    const Float out_of = max(part(seen.b), splat(0.05f));
    Vec3f t{fma(n.x, out_of, right.x + up.x), fma(n.y, out_of, right.y + up.y),
            fma(n.z, out_of, right.z + up.z)};
    const Float inverse = splat(1.0f) / sqrt(dot(t, t));
    const Vec3f c = from_geom(g.rot, {t.x * inverse, t.y * inverse, t.z * inverse});
    put(out.n[0], c.x);
    put(out.n[1], c.y);
    put(out.n[2], c.z);
  }
}

// Samples the textures for `lanes`, which all show geom g. The mipmap level follows from the surface's own
// plane, not from the normal by which it is shaded.
inline void texture_lanes(const View& view, const ViewGeom& g, const Pixels& pixels,
                          const Hits& hits, std::uint32_t lanes, const float (*local)[kLanes],
                          const float (*normal)[kLanes], Surfaces& out) {
  const Surface& s = g.surface;
  const Texture* const texture = s.texture;
  const bool cube = texture && texture->cube, flat = !cube || s.mapped;
  const bool plane = g.type == mjGEOM_PLANE, projected = plane || s.projected_along_z;
  const bool round = g.type == mjGEOM_CAPSULE || g.type == mjGEOM_CYLINDER;
  const bool curved = flat && !s.projected_along_z &&
                      (round || g.type == mjGEOM_SPHERE || g.type == mjGEOM_ELLIPSOID);
  const bool seen_through = g.transparent && texture && texture->alpha;
  Mapped mapped;
  if (g.mesh || curved) mapped = {};
  if (g.mesh) map_mesh(g, hits, lanes, mapped);
  if (curved) map_curved(g, lanes, local, normal, mapped);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(lanes >> k & kAllLanes);
    if (!any(m)) continue;
    const Vec3f q = load3(local, k);
    const Vec3f n = g.mesh ? from_geom(g.rot, load3(mapped.n, k)) : load3(out.n, k);
    const Steps steps = pixel_steps(view, g, pixels, hits, k, n);
    const auto store_sample = [&](auto sample_as) {
      const Rgb color = sample_as(Rgb{});
      const Float scale = splat(1.0f / 255);
      const bool encoded = view.physical.on && !texture->linear;
      const auto store_part = [&](int c, Float x) {
        const Float part = encoded ? srgb_to_linear(x * scale) : x * scale;
        store(out.texture[c] + k, select(m, part, load(out.texture[c] + k)));
      };
      store_part(0, color.r);
      store_part(1, color.g);
      store_part(2, color.b);
      if (!seen_through) return;
      const Float alpha = load(out.alpha + k);
      store(out.alpha + k, select(m, alpha * sample_as(Alpha{}).a * scale, alpha));
    };
    if (cube) {
      const auto stretched = [&](Vec3f v) -> Vec3f {
        return {v.x * s.cube_scale[0], v.y * s.cube_scale[1], v.z * s.cube_scale[2]};
      };
      const CubeFace face(stretched(q));
      const float width = texture->width[0];
      const Float footprint =
          max(face.texels(stretched(steps.x), width), face.texels(stretched(steps.y), width));
      store_sample(
          [&](auto texel) { return sample_cube<decltype(texel)>(*texture, m, face, footprint); });
      if (!flat) continue;
    }
    Coordinates at;
    float sx = 0, sy = 0;
    if (projected) {
      sx = g.size[0] > 0 ? 0.5f / g.size[0] : 0.5f;
      const float size_y = round ? g.size[0] : g.size[1];
      sy = size_y > 0 ? 0.5f / size_y : 0.5f;
      at.u = fma(q.x, splat(sx), splat(!s.projected_along_z && g.size[0] > 0 ? 0.5f : 0.0f));
      at.v = fma(q.y, splat(-sy), splat(!s.projected_along_z && g.size[1] > 0 ? 0.5f : 0.0f));
    } else {
      at = curved || s.uses_mesh_uvs ? mapped.coordinates(k) : box_uv(g, q, load3(normal, k));
    }
    // The maximum component, as in Mesa; it gives a sharper image than the length of the vector.
    const auto footprint_on = [&](const Texture& map) {
      const float width = map.width[0], height = map.height[0];
      if (projected) {
        const Float ku = splat(sx * s.uv_scale[0] * width), kv = splat(sy * s.uv_scale[1] * height);
        const auto texels = [&](Vec3f w) { return max(abs(ku * w.x), abs(kv * w.y)); };
        return max(texels(steps.x), texels(steps.y));
      }
      const Float ku = splat(s.uv_scale[0] * width), kv = splat(s.uv_scale[1] * height);
      const auto texels = [&](Vec3f w) {
        return max(abs(ku * dot(at.du, w)), abs(kv * dot(at.dv, w)));
      };
      return max(texels(steps.x), texels(steps.y));
    };
    const Float place_s = fma(at.u, splat(s.uv_scale[0]), splat(s.uv_offset[0])),
                place_t = fma(at.v, splat(s.uv_scale[1]), splat(s.uv_offset[1]));
    const auto read = [&](const Texture& map, auto texel) {
      return sample<decltype(texel)>(map, m, int_of(0), place_s, place_t, footprint_on(map));
    };
    if (texture && !cube) store_sample([&](auto texel) { return read(*texture, texel); });
    if (!s.mapped) continue;
    const Float zero = splat(0.0f), one = splat(1.0f);
    apply_maps(
        g, [&](const Texture& map) { return read(map, Rgb{}); },
        projected ? Vec3f{one, zero, zero} : at.du, projected ? Vec3f{zero, -one, zero} : at.dv,
        load3(normal, k), k, m, out);
  }
}

// Normals of triangles: interpolated if the mesh has vertex normals, else the face's own. Undefined
// in other lanes.
inline Vec3f triangle_normals(const ViewGeom& g, const Hits& hits, std::uint32_t lanes, int k) {
  if (!(g.mesh && g.mesh->normals))
    return {load(hits.n[0] + k), load(hits.n[1] + k), load(hits.n[2] + k)};
  alignas(64) float b0[kWidth];
  store(b0, splat(1.0f) - load(hits.u + k) - load(hits.v + k));
  Float4 rows[kWidth];
  for (int i = 0; i < kWidth; ++i) {
    rows[i] = Float4{};
    if (!(lanes >> (k + i) & 1u)) continue;
    const float* c = g.mesh->normals + 9 * hits.prim[k + i];
    rows[i] = b0[i] * load4(c) + hits.u[k + i] * load4(c + 3) + hits.v[k + i] * last3(c + 5);
  }
  const Vec4f n = columns(rows);
  return {n.x, n.y, n.z};
}

// The emission of surfaces whose material has no map of it: a share of their colour.
inline void set_glow(std::uint32_t lanes, Surfaces& out) {
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(lanes >> k & kAllLanes);
    if (!any(m)) continue;
    for (int c = 0; c < 3; ++c) {
      const Float glow = load(out.emission + k) * load(out.rgb[c] + k) * load(out.texture[c] + k);
      store(out.glow[c] + k, select(m, glow, load(out.glow[c] + k)));
    }
  }
}

// Gathers normals, materials and textures of the lanes `mine`, which all show g. `first`: g is the
// first geom of the packet; its values are written to all lanes, and other geoms overwrite theirs.
template <bool first>
void gather_geom(const View& view, const Pixels& pixels, const Hits& hits, const ViewGeom& g,
                 std::uint32_t mine, bool color, Surfaces& out) {
  const Surface& s = g.surface;
  if (g.mesh_on_demand) g.mesh_on_demand->prepare_surface(color && s.uses_mesh_uvs);
  alignas(64) float local[3][kLanes], normal[3][kLanes];
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(mine >> k & kAllLanes);
    if (!first && !any(m)) continue;
    const auto put = [&](float* to, Float x) {
      store(to + k, first ? x : select(m, x, load(to + k)));
    };
    const Vec3f p{load(out.p[0] + k), load(out.p[1] + k), load(out.p[2] + k)};
    const Vec3f q = to_geom(g.rot, p - splat(g.pos));
    Vec3f n = has_triangles(g) ? triangle_normals(g, hits, mine, k) : primitive_normal(g, q);
    if (g.type != mjGEOM_PLANE) {  // a plane's normal already has length 1
      const Float inverse = splat(1.0f) / sqrt(max(dot(n, n), splat(1e-30f)));
      n = {n.x * inverse, n.y * inverse, n.z * inverse};
    }
    const Vec3f c = from_geom(g.rot, n);
    put(out.n[0], c.x);
    put(out.n[1], c.y);
    put(out.n[2], c.z);
    if (!color) continue;
    for (int i = 0; i < 3; ++i) {
      put(out.rgb[i], splat(s.rgba[i]));
      put(out.texture[i], splat(1.0f));
    }
    put(out.alpha, splat(s.rgba[3]));
    put(out.specular, splat(s.specular));
    put(out.emission, splat(s.emission));
    if (view.physical.on) {
      put(out.roughness, splat(s.roughness));
      put(out.metallic, splat(s.metallic));
      put(out.occlusion, splat(1.0f));
    } else {
      put(out.exponent, splat(s.exponent));
      put(out.highlight_threshold, splat(s.highlight_threshold));
    }
    if (!s.texture && !s.mapped) continue;
    store(local[0] + k, q.x);
    store(local[1] + k, q.y);
    store(local[2] + k, q.z);
    store(normal[0] + k, n.x);
    store(normal[1] + k, n.y);
    store(normal[2] + k, n.z);
  }
  if (!color) return;
  if (s.texture || s.mapped) texture_lanes(view, g, pixels, hits, mine, local, normal, out);
  if (view.physical.on && !s.maps[kEmissiveMap]) set_glow(mine, out);
}

// Gathers points, normals (unit, camera frame) and materials of `lanes`. `color`: also what only
// the rgb image needs.
inline void gather_surfaces(const View& view, const Pixels& pixels, const Hits& hits,
                            std::uint32_t lanes, bool color, Surfaces& out) {
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p = hit_point(view, pixels, hits, k);
    store(out.p[0] + k, p.x);
    store(out.p[1] + k, p.y);
    store(out.p[2] + k, p.z);
  }
  for (std::uint32_t todo = lanes; todo;) {
    const int geom = hits.geom[__builtin_ctz(todo)];
    const ViewGeom& g = view.geoms[geom];
    std::uint32_t mine = 0;
    for (int k = 0; k < kLanes; k += kWidth) mine |= bits(load(hits.geom + k) == int_of(geom)) << k;
    mine &= todo;
    if (todo == lanes) {
      gather_geom<true>(view, pixels, hits, g, mine, color, out);
    } else {
      gather_geom<false>(view, pixels, hits, g, mine, color, out);
    }
    todo &= ~mine;
  }
}

}  // namespace
}  // namespace mjsense::render
