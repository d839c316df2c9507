// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/stored_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "mjsense/core/content_cache.h"
#include "mjsense/core/system/cpu.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

// Table of linear values by sRGB value.
std::array<std::uint8_t, 256> linear_values() {
  std::array<std::uint8_t, 256> table;
  for (int i = 0; i < 256; ++i) {
    table[i] = static_cast<std::uint8_t>(std::lround(255.0 * srgb_decode(i / 255.0)));
  }
  return table;
}

// Linear interpolation between two neighbouring texels of a row or column.
struct Interpolation {
  int first, second;
  float weight;  // of the second
};

// How texel i of a level, which has `coarse` texels along one axis, follows from those of the next
// finer level, which has `fine` texels there.
Interpolation interpolation_at(int i, int fine, int coarse) {
  const float x =
      (static_cast<float>(i) + 0.5f) * static_cast<float>(fine) / static_cast<float>(coarse) - 0.5f;
  const int first = static_cast<int>(x);
  return {first, std::min(first + 1, fine - 1), x - static_cast<float>(first)};
}

// A row of the coarser level with half the width: each texel is the rounded mean
// (a + b + c + d + 2) / 4 of 2 x 2 texels of two rows of the finer level.
MJSENSE_WIDE_TOO void average_2x2(const std::uint32_t* above, const std::uint32_t* below, int count,
                                  std::uint32_t* out) {
  // A pair as four sums of 16 bits: red and blue, then green and alpha.
  constexpr std::uint64_t kChannels = 0x00ff00ff00ff00ff;
  constexpr std::uint32_t kHalf = 0x00020002;  // rounds the division by four
  const auto mean = [](auto upper, auto lower, int shift) {
    const auto sums = (upper >> shift & kChannels) + (lower >> shift & kChannels);
    return (sums + (sums >> 32) + kHalf) >> 2 & 0x00ff00ff;
  };
  constexpr int kPairs = 2;
  using Pairs [[gnu::vector_size(8 * kPairs)]] = std::uint64_t;
  using Texels [[gnu::vector_size(4 * kPairs)]] = std::uint32_t;
  int x = 0;
  for (; x + kPairs <= count; x += kPairs) {
    Pairs upper, lower;
    std::memcpy(&upper, above + 2 * x, sizeof upper);
    std::memcpy(&lower, below + 2 * x, sizeof lower);
    const Pairs means = mean(upper, lower, 0) | mean(upper, lower, 8) << 8;
    const Texels texels = __builtin_convertvector(means, Texels);
    std::memcpy(out + x, &texels, sizeof texels);
  }
  for (; x < count; ++x) {
    std::uint64_t upper, lower;
    std::memcpy(&upper, above + 2 * x, sizeof upper);
    std::memcpy(&lower, below + 2 * x, sizeof lower);
    out[x] = static_cast<std::uint32_t>(mean(upper, lower, 0) | mean(upper, lower, 8) << 8);
  }
}

// A row of the coarser level by bilinear interpolation: between two rows of the finer level, where
// `below` has the weight v, and between their columns.
MJSENSE_WIDE_TOO void interpolate_row(const std::uint32_t* above, const std::uint32_t* below,
                                      float v, std::span<const Interpolation> columns,
                                      std::uint32_t* out) {
  using Channels [[gnu::vector_size(16)]] = float;
  using Words [[gnu::vector_size(16)]] = std::int32_t;
  constexpr Words kShifts = {0, 8, 16, 24};
  const auto unpacked = [&](std::uint32_t texel) {
    const auto word = static_cast<std::int32_t>(texel);
    const Words words = Words{word, word, word, word} >> kShifts & 255;
    return __builtin_convertvector(words, Channels);
  };
  for (const Interpolation& u : columns) {
    const auto mix = [&](const std::uint32_t* row) {
      const Channels first = unpacked(row[u.first]);
      return first + u.weight * (unpacked(row[u.second]) - first);
    };
    const Channels upper = mix(above);
    const Channels value = upper + v * (mix(below) - upper) + 0.5f;
    const Words words = __builtin_convertvector(value, Words) << kShifts;
    *out++ = static_cast<std::uint32_t>(words[0] | words[1] | words[2] | words[3]);
  }
}

// Texels of three bytes to opaque texels of four.
MJSENSE_WIDE_TOO void opaque_row(const mjtByte* from, int count, std::uint32_t* out) {
  using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
  using Texels [[gnu::vector_size(16)]] = std::uint32_t;
  int x = 0;
  for (; x + 6 <= count; x += 4, from += 12) {  // reads 16 bytes
    Bytes bytes;
    std::memcpy(&bytes, from, sizeof bytes);
    const auto spread =
        __builtin_shufflevector(bytes, bytes, 0, 1, 2, 0, 3, 4, 5, 0, 6, 7, 8, 0, 9, 10, 11, 0);
    const Texels texels = (Texels)spread | 0xff000000;
    std::memcpy(out + x, &texels, sizeof texels);
  }
  for (; x < count; ++x, from += 3) out[x] = from[0] | from[1] << 8 | from[2] << 16 | 0xff000000;
}

// Computes a mipmap level from the next finer one, by interpolation at the centres of its texels, as
// OpenGL drivers do. If the finer level has twice its size, this is the mean of 2 x 2 texels. For odd
// sizes, it neither shifts the image nor drops its border.
class MipmapFilter {
 public:
  // For the level after `finer`.
  MipmapFilter(const Texture& texture, int finer)
      : width_(static_cast<int>(texture.width[finer + 1])),
        height_(static_cast<int>(texture.height[finer + 1])),
        finer_height_(static_cast<int>(texture.height[finer])) {
    const int finer_width = static_cast<int>(texture.width[finer]);
    exact_half_ = finer_width == 2 * width_ && finer_height_ == 2 * height_;
    for (int x = 0; x < width_ && !exact_half_; ++x)
      columns_.push_back(interpolation_at(x, finer_width, width_));
  }

  // Computes row y from finer_row(i), row i of the finer level. Its last two results must stay valid.
  template <class FinerRow>
  void compute(int y, FinerRow finer_row, std::uint32_t* out) const {
    const Interpolation v = exact_half_ ? Interpolation{2 * y, 2 * y + 1, 0}
                                        : interpolation_at(y, finer_height_, height_);
    const std::uint32_t *above = finer_row(v.first), *below = finer_row(v.second);
    if (exact_half_) {
      average_2x2(above, below, width_, out);
    } else {
      interpolate_row(above, below, v.weight, columns_, out);
    }
  }

 private:
  int width_, height_, finer_height_;  // texels
  bool exact_half_;
  std::vector<Interpolation> columns_;  // by texel of a row, unless exact_half_
};

// Models of MuJoCo before 3.3.3 have no colour spaces.
int color_space(const mjModel* model, int id) {
  return model->tex_colorspace ? model->tex_colorspace[id] : mjCOLORSPACE_AUTO;
}

// Images that are stored in each level.
int num_images(const Texture& texture) { return texture.cube && !texture.same_faces ? 6 : 1; }

// Rows of level 0, converted from the model's texture to linear RGBA8.
class SourceRows {
 public:
  SourceRows(const mjModel* model, int id, const Texture& texture, int face)
      : channels_(model->tex_nchannel[id]),
        width_(model->tex_width[id]),
        srgb_(color_space(model, id) == mjCOLORSPACE_SRGB && !texture.cube),
        data_(model->tex_data + model->tex_adr[id] +
              bytes(face * static_cast<int>(texture.height[0]))) {}

  void compute(int y, std::uint32_t* out) const {
    static const std::array<std::uint8_t, 256> linear = linear_values();
    const mjtByte* from = data_ + bytes(y);
    if (!srgb_ && channels_ == 3) return opaque_row(from, width_, out);
    if (channels_ == 1) {
      for (int x = 0; x < width_; ++x)
        out[x] = 0xff000000 | 0x010101u * (srgb_ ? linear[from[x]] : from[x]);
      return;
    }
    for (int x = 0; x < width_; ++x, from += channels_) {
      const std::uint32_t alpha = channels_ == 4 ? from[3] : 255;
      out[x] = srgb_ ? linear[from[0]] | linear[from[1]] << 8 | linear[from[2]] << 16 | alpha << 24
                     : from[0] | from[1] << 8 | from[2] << 16 | alpha << 24;
    }
  }

 private:
  std::size_t bytes(int rows) const { return static_cast<std::size_t>(rows) * width_ * channels_; }
  int channels_, width_;
  bool srgb_;
  const mjtByte* data_;
};

// Rows of a mipmap level, computed from the source without storing the finer levels.
class LevelRows {
 public:
  LevelRows(const SourceRows& source, const Texture& texture, int level) : source_(source) {
    if (level > 0) {
      finer_ = std::make_unique<LevelRows>(source, texture, level - 1);
      filter_ = std::make_unique<MipmapFilter>(texture, level - 1);
    }
    for (std::vector<std::uint32_t>& row : rows_)
      row.resize(static_cast<std::size_t>(texture.width[level]));
  }

  void compute(int y, std::uint32_t* out) {
    if (!finer_) return source_.compute(y, out);
    filter_->compute(
        y, [this](int i) { return finer_->row(i); }, out);
  }

 private:
  const std::uint32_t* row(int y) {
    std::vector<std::uint32_t>& kept = rows_[y % 2];
    if (std::exchange(indices_[y % 2], y) != y) compute(y, kept.data());
    return kept.data();
  }

  const SourceRows& source_;
  std::unique_ptr<LevelRows> finer_;      // null: level 0, which is the source
  std::unique_ptr<MipmapFilter> filter_;  // from `finer_`
  std::vector<std::uint32_t> rows_[2];    // the last even and the last odd row
  int indices_[2] = {-1, -1};             // of rows_
};

// Sets the offsets of the stored levels, and allocates their texels.
void allocate_levels(StoredTexture& out) {
  Texture& texture = out.texture;
  std::size_t total = 0;
  for (int level = texture.finest; level < texture.levels; ++level) {
    texture.offset[level] = static_cast<int>(total);
    total += num_images(texture) * static_cast<std::size_t>(texture.width[level] + 1) *
             static_cast<std::size_t>(texture.height[level]);
  }
  out.texels = std::make_unique_for_overwrite<std::uint32_t[]>(total);
  texture.texels = out.texels.get();
}

// Fills the stored levels of one image: the finest from the source, each other from the one before.
void fill_levels(const SourceRows& source, int image, StoredTexture& out) {
  const Texture& texture = out.texture;
  LevelRows finest(source, texture, texture.finest);
  const std::uint32_t* finer = nullptr;  // texels of the level before; null for the finest
  std::size_t finer_stride = 0;          // texels from one of its rows to the next
  for (int n = texture.finest; n < texture.levels; ++n) {
    const int width = static_cast<int>(texture.width[n]),
              height = static_cast<int>(texture.height[n]);
    const std::size_t stride = width + 1;
    std::uint32_t* level = out.texels.get() + texture.offset[n] + image * stride * height;
    std::unique_ptr<MipmapFilter> filter;
    if (finer) filter = std::make_unique<MipmapFilter>(texture, n - 1);
    for (int y = 0; y < height; ++y) {
      std::uint32_t* row = level + y * stride;
      if (finer) {
        filter->compute(
            y, [&](int i) { return finer + i * finer_stride; }, row);
      } else {
        finest.compute(y, row);
      }
      row[width] = row[texture.cube ? width - 1 : 0];
    }
    finer = level;
    finer_stride = stride;
  }
}

// Sets the mean colour of a texture of three or four channels.
void set_mean(const mjModel* model, int id, Texture& out) {
  static const std::array<double, 256> linear = [] {
    std::array<double, 256> table;
    for (int i = 0; i < 256; ++i) table[i] = srgb_decode(i / 255.0);
    return table;
  }();
  const int channels = model->tex_nchannel[id], width = model->tex_width[id];
  const int height = out.cube ? width : model->tex_height[id];
  const mjtByte* texels = model->tex_data + model->tex_adr[id];
  const int columns = std::min(width, 32), rows = std::min(height, 32);
  double sum[3] = {};
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const auto at = (y * height / rows) * static_cast<std::size_t>(width) + x * width / columns;
      for (int c = 0; c < 3; ++c) sum[c] += linear[texels[at * channels + c]];
    }
  for (int c = 0; c < 3; ++c) out.mean[c] = static_cast<float>(sum[c] / (columns * rows));
}

}  // namespace

Texture texture_levels(const mjModel* model, int id) {
  Texture texture;
  const int channels = model->tex_nchannel[id];
  // Textures with another number of channels are encoded for another renderer and ignored.
  if (channels != 1 && channels != 3 && channels != 4) return texture;
  texture.alpha = channels == 4;
  texture.grey = channels == 1;
  texture.cube = model->tex_type[id] != mjTEXTURE_2D;
  // MuJoCo marks PNG files without a colour space as linear, though their colours are encoded.
  texture.linear = color_space(model, id) == mjCOLORSPACE_SRGB && !texture.cube;
  // A cube texture with a square image repeats that image on all faces.
  texture.same_faces = texture.cube && model->tex_width[id] == model->tex_height[id];
  int width = model->tex_width[id], height = texture.cube ? width : model->tex_height[id];
  for (; texture.levels < Texture::kMaxLevels;
       width = std::max(1, width / 2), height = std::max(1, height / 2)) {
    texture.width[texture.levels] = static_cast<float>(width);
    texture.height[texture.levels++] = static_cast<float>(height);
    if (width == 1 && height == 1) break;
  }
  texture.finest = texture.levels;
  if (!texture.grey) set_mean(model, id, texture);
  return texture;
}

std::shared_ptr<const StoredTexture> stored_texture(const mjModel* m, int id, int finest) {
  static ContentCache<StoredTexture> all;
  auto made = std::make_shared<StoredTexture>();
  made->texture = texture_levels(m, id);
  if (made->texture.levels == 0) return made;
  const int channels = m->tex_nchannel[id], width = m->tex_width[id], height = m->tex_height[id];
  const int form[] = {m->tex_type[id], color_space(m, id), channels, width, height, finest};
  const std::size_t bytes = static_cast<std::size_t>(width) * height * channels;
  const ContentKey key = ContentKey()
                             .add(std::span<const int>(form))
                             .add(std::span(m->tex_data + m->tex_adr[id], bytes));
  return all.get(key, [&] {
    made->texture.finest = finest;
    allocate_levels(*made);
    for (int image = 0; image < num_images(made->texture); ++image)
      fill_levels(SourceRows(m, id, made->texture, image), image, *made);
    return made;
  });
}

}  // namespace mjsense::render
