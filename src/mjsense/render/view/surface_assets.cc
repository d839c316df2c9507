// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/surface_assets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "mjsense/core/content_cache.h"
#include "mjsense/rays/flex_surface.h"

namespace mjsense::render {
namespace {

// If the cosine between a vertex normal and the face's normal is below this, the corner is on a
// crease and MuJoCo shades it flat.
constexpr float kCrease = 0.8f;

// Table of linear values by sRGB value.
std::array<std::uint8_t, 256> linear_values() {
  std::array<std::uint8_t, 256> table;
  for (int i = 0; i < 256; ++i) {
    const double v = i / 255.0;
    const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    table[i] = static_cast<std::uint8_t>(std::lround(255.0 * linear));
  }
  return table;
}

// Writes (b - a) x (c - a) and returns its length.
float cross(const float* a, const float* b, const float* c, float* out) {
  const float e1[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const float e2[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  for (int i = 0; i < 3; ++i)
    out[i] = e1[(i + 1) % 3] * e2[(i + 2) % 3] - e1[(i + 2) % 3] * e2[(i + 1) % 3];
  return std::sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
}

// The two texels of a row of `size` between which texel i of the next level's row of `half` lies.
struct Between {
  int first, second;
  float weight;  // of the second
};
Between between(int i, int size, int half) {
  const float x =
      (static_cast<float>(i) + 0.5f) * static_cast<float>(size) / static_cast<float>(half) - 0.5f;
  const int first = static_cast<int>(x);
  return {first, std::min(first + 1, size - 1), x - static_cast<float>(first)};
}

// An image of a mip level. Each row has one more texel at its end (see Texture).
struct Image {
  std::uint32_t* texels;
  int width, height;

  std::uint32_t* row(int y) const { return texels + static_cast<std::size_t>(y) * (width + 1); }
};

// Functions that go over all texels are compiled for wide vectors too. Without fused operations, so
// that the results are the same.
#ifdef __x86_64__
#define MJSENSE_VECTORS [[gnu::target_clones("avx2", "default")]]
#else
#define MJSENSE_VECTORS
#endif

// Computes the next mip level of one image by interpolation at its texels' centres, as OpenGL
// drivers do. For even sizes this is the mean of 2 x 2 texels; for odd sizes it neither shifts the
// image nor drops its border.
MJSENSE_VECTORS void halve(const Image& src, const Image& dst) {
  if (src.width == 2 * dst.width && src.height == 2 * dst.height) {
    // Two neighbours at once, as four sums of 16 bits: red and blue, then green and alpha.
    constexpr std::uint64_t kChannels = 0x00ff00ff00ff00ff;
    constexpr std::uint32_t kHalf = 0x00020002;  // rounds the division by four
    for (int y = 0; y < dst.height; ++y) {
      const std::uint32_t *above = src.row(2 * y), *below = src.row(2 * y + 1);
      std::uint32_t* out = dst.row(y);
      for (int x = 0; x < dst.width; ++x, above += 2, below += 2) {
        std::uint64_t upper, lower;
        std::memcpy(&upper, above, sizeof upper);
        std::memcpy(&lower, below, sizeof lower);
        const auto mean = [&](int shift) {
          const std::uint64_t sums = (upper >> shift & kChannels) + (lower >> shift & kChannels);
          return static_cast<std::uint32_t>(((sums + (sums >> 32) + kHalf) >> 2 & kChannels));
        };
        out[x] = mean(0) | mean(8) << 8;
      }
    }
    return;
  }
  using Channels [[gnu::vector_size(16)]] = float;
  using Words [[gnu::vector_size(16)]] = std::int32_t;
  constexpr Words kShifts = {0, 8, 16, 24};
  const auto unpacked = [&](std::uint32_t texel) {
    const auto word = static_cast<std::int32_t>(texel);
    const Words words = Words{word, word, word, word} >> kShifts & 255;
    return __builtin_convertvector(words, Channels);
  };
  std::vector<Between> columns(dst.width);
  for (int x = 0; x < dst.width; ++x) columns[x] = between(x, src.width, dst.width);
  for (int y = 0; y < dst.height; ++y) {
    const Between v = between(y, src.height, dst.height);
    const std::uint32_t *above = src.row(v.first), *below = src.row(v.second);
    std::uint32_t* out = dst.row(y);
    for (int x = 0; x < dst.width; ++x) {
      const Between& u = columns[x];
      const auto mix = [&](const std::uint32_t* row) {
        const Channels first = unpacked(row[u.first]);
        return first + u.weight * (unpacked(row[u.second]) - first);
      };
      const Channels upper = mix(above);
      const Channels value = upper + v.weight * (mix(below) - upper) + 0.5f;
      const Words words = __builtin_convertvector(value, Words) << kShifts;
      out[x] = static_cast<std::uint32_t>(words[0] | words[1] | words[2] | words[3]);
    }
  }
}

// position(f, k), m, and texcoord(f, k) return the data of corner k of face f.
template <class Position, class Texcoord>
void add_coordinates(MeshTables& tables, int faces, Position position, Texcoord texcoord) {
  tables.uvs.resize(static_cast<std::size_t>(faces) * 6);
  tables.density.resize(faces);
  for (int f = 0; f < faces; ++f) {
    float* uv = tables.uvs.data() + 6 * f;
    for (int k = 0; k < 3; ++k) std::copy_n(texcoord(f, k), 2, uv + 2 * k);
    float normal[3];
    const float area = cross(position(f, 0), position(f, 1), position(f, 2), normal);
    const float uv_area =
        std::abs((uv[2] - uv[0]) * (uv[5] - uv[1]) - (uv[4] - uv[0]) * (uv[3] - uv[1]));
    tables.density[f] = area > 0 ? std::sqrt(uv_area / area) : 0;
  }
}

// Models of MuJoCo before 3.3.3 have no colour spaces.
int color_space(const mjModel* model, int id) {
  return model->tex_colorspace ? model->tex_colorspace[id] : mjCOLORSPACE_AUTO;
}

void fill_texture(const mjModel* model, int id, StoredTexture& out) {
  Texture& texture = out.texture;
  const int channels = model->tex_nchannel[id];
  texture.cube = model->tex_type[id] != mjTEXTURE_2D;
  const int width = model->tex_width[id];
  // A cube texture with a square image repeats that image on all faces.
  texture.same_faces = texture.cube && model->tex_width[id] == model->tex_height[id];
  const int height = texture.cube ? width : model->tex_height[id];
  const int faces = texture.cube && !texture.same_faces ? 6 : 1;
  const bool srgb = color_space(model, id) == mjCOLORSPACE_SRGB && !texture.cube;
  const mjtByte* data = model->tex_data + model->tex_adr[id];
  const std::array<std::uint8_t, 256> linear = linear_values();

  std::size_t total = 0;
  for (int w = width, h = height, n = 0; n < Texture::kMaxLevels; ++n) {
    texture.width[n] = static_cast<float>(w);
    texture.height[n] = static_cast<float>(h);
    texture.offset[n] = static_cast<int>(total);
    total += static_cast<std::size_t>(faces) * (w + 1) * h;
    ++texture.levels;
    if (w == 1 && h == 1) break;
    w = std::max(1, w / 2);
    h = std::max(1, h / 2);
  }
  out.texels = std::make_unique_for_overwrite<std::uint32_t[]>(total);
  texture.texels = out.texels.get();
  const auto image = [&](int level, int face) {
    const int w = static_cast<int>(texture.width[level]),
              h = static_cast<int>(texture.height[level]);
    return Image{
        out.texels.get() + texture.offset[level] + static_cast<std::size_t>(face) * (w + 1) * h, w,
        h};
  };
  for (int f = 0; f < faces; ++f) {
    const Image first = image(0, f);
    const mjtByte* from = data + static_cast<std::size_t>(f) * width * height * channels;
    for (int y = 0; y < height; ++y) {
      std::uint32_t* row = first.row(y);
      int x = 0;
      if (!srgb && channels == 3) {
        // Whole words, which read one byte of the next texel.
        for (; x + 1 < width; ++x, from += 3) {
          std::uint32_t texel;
          std::memcpy(&texel, from, sizeof texel);
          row[x] = texel | 0xff000000;
        }
      }
      for (; x < width; ++x, from += channels) {
        const std::uint32_t alpha = channels == 4 ? from[3] : 255;
        row[x] = srgb ? linear[from[0]] | linear[from[1]] << 8 | linear[from[2]] << 16 | alpha << 24
                      : from[0] | from[1] << 8 | from[2] << 16 | alpha << 24;
      }
    }
    for (int n = 0; n + 1 < texture.levels; ++n) halve(image(n, f), image(n + 1, f));
    for (int n = 0; n < texture.levels; ++n) {
      const Image level = image(n, f);
      for (int y = 0; y < level.height; ++y)
        level.row(y)[level.width] = level.row(y)[texture.cube ? level.width - 1 : 0];
    }
  }
}

}  // namespace

void add_coordinates(MeshTables& tables, int count, const float* vert, const int* faces,
                     const float* texcoord, const int* texcoords) {
  add_coordinates(
      tables, count, [&](int f, int k) { return vert + 3 * faces[3 * f + k]; },
      [&](int f, int k) { return texcoord + 2 * texcoords[3 * f + k]; });
}

std::shared_ptr<const StoredTexture> stored_texture(const mjModel* m, int id) {
  static ContentCache<StoredTexture> all;
  const int channels = m->tex_nchannel[id], width = m->tex_width[id], height = m->tex_height[id];
  // Textures with another number of channels are encoded for another renderer and ignored.
  if (channels != 3 && channels != 4) return std::make_shared<const StoredTexture>();
  const int form[] = {m->tex_type[id], color_space(m, id), channels, width, height};
  const std::size_t bytes = static_cast<std::size_t>(width) * height * channels;
  const ContentKey key = ContentKey()
                             .add(std::span<const int>(form))
                             .add(std::span(m->tex_data + m->tex_adr[id], bytes));
  return all.get(key, [&] {
    auto made = std::make_shared<StoredTexture>();
    fill_texture(m, id, *made);
    return made;
  });
}

std::shared_ptr<const MeshTables> mesh_tables(const mjModel* m, int id) {
  const int faces = m->mesh_facenum[id], first = m->mesh_faceadr[id];
  const bool has_uv = m->mesh_texcoordadr[id] >= 0;
  // The mesh's range of an array with `width` numbers per row.
  const auto part = [](auto* all, int begin, int count, int width) {
    return std::span(all + static_cast<std::size_t>(begin) * width,
                     static_cast<std::size_t>(count) * width);
  };
  const auto vert = part(m->mesh_vert, m->mesh_vertadr[id], m->mesh_vertnum[id], 3);
  const auto normal = part(m->mesh_normal, m->mesh_normaladr[id], m->mesh_normalnum[id], 3);
  const auto vertices = part(m->mesh_face, first, faces, 3);
  const auto normals = part(m->mesh_facenormal, first, faces, 3);
  std::span<float> texcoord;
  std::span<int> texcoords;
  if (has_uv) {
    texcoord = part(m->mesh_texcoord, m->mesh_texcoordadr[id], m->mesh_texcoordnum[id], 2);
    texcoords = part(m->mesh_facetexcoord, first, faces, 3);
  }
  static ContentCache<MeshTables> all;
  ContentKey key;
  for (const auto& values : {vert, normal, texcoord}) key.add(values);
  for (const auto& values : {vertices, normals, texcoords}) key.add(values);
  return all.get(key, [&] {
    auto tables = std::make_shared<MeshTables>();
    tables->normals.resize(static_cast<std::size_t>(faces) * 9);
    for (int f = 0; f < faces; ++f) {
      const int *v = &vertices[3 * f], *n = &normals[3 * f];
      float flat[3];
      const float length = cross(&vert[3 * v[0]], &vert[3 * v[1]], &vert[3 * v[2]], flat);
      for (float& x : flat) x = length > 0 ? x / length : 0;
      for (int k = 0; k < 3; ++k) {
        const float* smooth = &normal[3 * n[k]];
        const float cosine = smooth[0] * flat[0] + smooth[1] * flat[1] + smooth[2] * flat[2];
        const float* use = !has_uv && cosine < kCrease ? flat : smooth;
        std::copy(use, use + 3, tables->normals.begin() + 9 * f + 3 * k);
      }
    }
    if (has_uv)
      add_coordinates(*tables, faces, vert.data(), vertices.data(), texcoord.data(),
                      texcoords.data());
    return tables;
  });
}

MeshSurface MeshTables::surface() const {
  const auto data = [](const std::vector<float>& v) { return v.empty() ? nullptr : v.data(); };
  return {data(normals), data(uvs), data(density)};
}

void SurfaceAssets::keep(std::shared_ptr<const MeshTables> tables, MeshSurface& surface) {
  surface = tables->surface();
  tables_.push_back(std::move(tables));
}

SurfaceAssets::SurfaceAssets(const mjModel* model, bool meshes, bool textures) {
  textures_.resize(model->ntex);
  meshes_.resize(model->nmesh);
  skins_.resize(model->nskin);
  for (int i = 0; i < model->nflex; ++i) add_flex(model, i, textures);
  for (int i = 0; i < model->nskin && textures; ++i) add_skin(model, i);
  for (int i = 0; i < model->ntex && textures; ++i)
    textures_[i] = stored_.emplace_back(stored_texture(model, i))->texture;
  for (int i = 0; i < model->ntex && !skybox_; ++i)
    if (model->tex_type[i] == mjTEXTURE_SKYBOX && textures_[i].levels > 0) skybox_ = &textures_[i];
  for (int i = 0; i < model->nmesh && meshes; ++i) keep(mesh_tables(model, i), meshes_[i]);
}

void SurfaceAssets::add_flex(const mjModel* model, int id, bool textures) {
  const rays::FlexSurface s = rays::flex_surface(model, id);
  for (const rays::FlexSurface::Part& part : s.parts) {
    flex_parts_.emplace_back();
    if (s.texcoords.empty() || !textures) continue;
    auto tables = std::make_shared<MeshTables>();
    const float* texcoord = model->flex_texcoord + 2 * model->flex_texcoordadr[id];
    const auto corner = [&](int f, int k) { return 3 * (part.first + f) + k; };
    add_coordinates(
        *tables, part.count,
        [&](int f, int k) { return &s.rest[3 * (s.faces[corner(f, k)] % s.num_vertices)]; },
        [&](int f, int k) { return texcoord + 2 * s.texcoords[corner(f, k)]; });
    keep(std::move(tables), flex_parts_.back());
  }
}

void SurfaceAssets::add_skin(const mjModel* model, int id) {
  if (model->skin_texcoordadr[id] < 0) return;
  const float* vert = model->skin_vert + 3 * model->skin_vertadr[id];
  const float* texcoord = model->skin_texcoord + 2 * model->skin_texcoordadr[id];
  const int* face = model->skin_face + 3 * model->skin_faceadr[id];
  auto tables = std::make_shared<MeshTables>();
  add_coordinates(*tables, model->skin_facenum[id], vert, face, texcoord, face);
  keep(std::move(tables), skins_[id]);
}

}  // namespace mjsense::render
