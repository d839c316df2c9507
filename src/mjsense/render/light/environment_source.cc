// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/environment_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "mjsense/core/content_cache.h"
#include "mjsense/core/error.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/render/light/cube_map.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

constexpr int kLevels = 9;
// Texels along a face's edge. With fewer, interpolation between them is visible in smooth spheres.
constexpr int kFaceSizes[kLevels] = {256, 64, 32, 32, 16, 16, 16, 16, 16};
constexpr int kSamples = 128;

// The radiance with all its halved images, for means over a solid angle.
class Pyramid {
 public:
  explicit Pyramid(const EnvironmentImage& image) : images_{image} {
    while (images_.back().height > 1) images_.push_back(images_.back().halved());
  }

  // The level whose pixels have about this solid angle, sr.
  double level_of(double solid_angle) const {
    const double pixel =
        4 * std::numbers::pi / (static_cast<double>(images_[0].width) * images_[0].height);
    return std::clamp(0.5 * std::log2(std::max(solid_angle / pixel, 1e-9)), 0.0,
                      static_cast<double>(images_.size() - 1));
  }

  // The mean around the direction, of pixels of this level.
  std::array<float, 3> at(const Vec3& direction, double level) const {
    const EnvironmentImage::Angles angles = EnvironmentImage::angles_of(direction);
    const auto finer = static_cast<std::size_t>(level);
    const auto between = static_cast<float>(level - static_cast<double>(finer));
    std::array<float, 3> out = images_[finer].at(angles);
    if (between == 0) return out;
    const std::array<float, 3> coarse = images_[finer + 1].at(angles);
    for (int c = 0; c < 3; ++c) out[c] += between * (coarse[c] - out[c]);
    return out;
  }

 private:
  std::vector<EnvironmentImage> images_;
};

// What a lobe sees around its normal, by filtered importance sampling: J. Krivanek, M. Colbert,
// Real-time Shading with Filtered Importance Sampling, EGSR 2008. The points are the same for all
// directions.
class Lobe {
 public:
  Lobe(double roughness, const Pyramid& radiance) : radiance_(radiance) {
    const double alpha = alpha_of(roughness);
    for (int i = 0; i < kSamples; ++i) {
      const double u = radical_inverse(i), angle = 2 * std::numbers::pi * (i + 0.5) / kSamples;
      const double cosine = std::sqrt((1 - u) / (1 + (alpha * alpha - 1) * u));
      const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
      const double n_l = 2 * cosine * cosine - 1;
      if (n_l <= 0) continue;
      // With N = V, the density of L is D(H) (N . H) / (4 V . H) = D(H) / 4.
      samples_.push_back(
          {{2 * cosine * sine * std::cos(angle), 2 * cosine * sine * std::sin(angle), n_l},
           radiance.level_of(4 / (kSamples * ggx(cosine, alpha)))});
      total_ += n_l;
    }
  }

  std::array<float, 3> seen(const Vec3& n) const {
    const auto [x, y] = tangents(n);
    double sum[3] = {};
    for (const auto& [l, level] : samples_) {
      Vec3 d;
      for (int k = 0; k < 3; ++k) d[k] = l[0] * x[k] + l[1] * y[k] + l[2] * n[k];
      const std::array<float, 3> color = radiance_.at(d, level);
      for (int c = 0; c < 3; ++c) sum[c] += l[2] * color[c];
    }
    std::array<float, 3> out;
    for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(sum[c] / total_);
    return out;
  }

 private:
  struct Sample {
    Vec3 l;
    double level;
  };
  const Pyramid& radiance_;
  std::vector<Sample> samples_;
  double total_ = 0;
};

// The direction of texel (x, y) of a face of `size` texels.
Vec3 texel_direction(int face, int x, int y, int size) {
  return cube_direction(
      {face, (2.0 * x - (size - 1)) / (size - 1), (2.0 * y - (size - 1)) / (size - 1)});
}

void prefilter(const EnvironmentImage& image, Environment& out) {
  Texture& texture = out.light.radiance;
  texture.cube = true;
  texture.levels = kLevels;
  int total = 0;
  for (int level = 0; level < kLevels; ++level) {
    const int size = kFaceSizes[level];
    texture.width[level] = texture.height[level] = static_cast<float>(size);
    texture.offset[level] = total;
    total += 6 * size * (size + 1);
  }
  out.texels.resize(total);
  texture.texels = out.texels.data();
  const Pyramid radiance(image);
  ThreadPool threads(0);
  for (int level = 0; level < kLevels; ++level) {
    const int size = kFaceSizes[level];
    const Lobe lobe(static_cast<double>(level) / (kLevels - 1), radiance);
    const double texel = radiance.level_of(4 * std::numbers::pi / (6.0 * size * size));
    threads.run(6 * size, [&](int item, int) {
      const int face = item / size, y = item % size;
      std::uint32_t* row = out.texels.data() + texture.offset[level] + item * (size + 1);
      for (int x = 0; x < size; ++x) {
        const Vec3 d = texel_direction(face, x, y, size);
        const std::array<float, 3> color = level ? lobe.seen(d) : radiance.at(d, texel);
        row[x] = pack_rgb9e5(color.data());
      }
      row[size] = row[size - 1];
    });
  }
}

std::array<double, 9> basis(const Vec3& n) {
  const auto [x, y, z] = n;
  return {1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y};
}

void project(const EnvironmentImage& image, float out[9][3]) {
  // Squares of the constants of the harmonics, times the share of each band that a cosine lobe
  // keeps: 1, 2/3, 1/4.
  constexpr double kScale[9] = {
      1 / (4 * std::numbers::pi),  1 / (2 * std::numbers::pi),   1 / (2 * std::numbers::pi),
      1 / (2 * std::numbers::pi),  15 / (16 * std::numbers::pi), 15 / (16 * std::numbers::pi),
      5 / (64 * std::numbers::pi), 15 / (16 * std::numbers::pi), 15 / (64 * std::numbers::pi)};
  double sums[9][3] = {};
  const float* pixel = image.rgb.data();
  for (int y = 0; y < image.height; ++y) {
    const double weight = image.solid_angle(y);
    for (int x = 0; x < image.width; ++x, pixel += 3) {
      const std::array<double, 9> b = basis(image.direction(x + 0.5, y + 0.5));
      for (int i = 0; i < 9; ++i)
        for (int c = 0; c < 3; ++c) sums[i][c] += weight * kScale[i] * b[i] * pixel[c];
    }
  }
  for (int c = 0; c < 3; ++c) {
    // Nine terms can be slightly negative opposite to a small bright light: then all but the mean
    // are reduced.
    double least = 0;
    for (int k = 0; k < 2048; ++k) {
      const double z = 1 - (2 * k + 1) / 2048.0, angle = k * std::numbers::pi * (3 - std::sqrt(5));
      const double r = std::sqrt(1 - z * z);
      const std::array<double, 9> b = basis({r * std::cos(angle), r * std::sin(angle), z});
      double change = 0;
      for (int i = 1; i < 9; ++i) change += sums[i][c] * b[i];
      least = std::min(least, change);
    }
    const double keep = least < -sums[0][c] ? -sums[0][c] / least : 1;
    for (int i = 0; i < 9; ++i) out[i][c] = static_cast<float>(sums[i][c] * (i ? keep : 1));
  }
}

// Scales the image so that the mean luminance is 1. Black stays black.
void normalize(EnvironmentImage& image) {
  double mean = 0;
  const float* pixel = image.rgb.data();
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x, pixel += 3)
      mean +=
          image.solid_angle(y) / (4 * std::numbers::pi) * luminance({pixel[0], pixel[1], pixel[2]});
  if (mean > 0)
    for (float& value : image.rgb) value = static_cast<float>(value / mean);
}

bool is_color(const mjModel* m, int id) {
  return m->tex_nchannel[id] == 3 || m->tex_nchannel[id] == 4;
}

int skybox_of(const mjModel* m) {
  for (int i = 0; i < m->ntex; ++i)
    if (m->tex_type[i] == mjTEXTURE_SKYBOX && is_color(m, i)) return i;
  return -1;
}

// By the content of a texture or a file. The last four stay for later recordings and renderers of the process, because preparing
// one takes tenths of a second; each has 2 MB.
ContentCache<Environment>& prepared_sources() {
  static ContentCache<Environment> all(4);
  return all;
}

std::shared_ptr<const Environment> of_texture(const mjModel* m, int id) {
  const int sizes[] = {m->tex_width[id], m->tex_height[id], m->tex_nchannel[id]};
  const std::size_t bytes = std::size_t{1} * sizes[0] * sizes[1] * sizes[2];
  const ContentKey key = ContentKey()
                             .add(std::span<const int>(sizes))
                             .add(std::span<const mjtByte>(m->tex_data + m->tex_adr[id], bytes));
  return prepared_sources().get(key, [&] { return prepared(skybox_image(m, id)); });
}

[[noreturn]] void throw_no_environment(const std::string& name) {
  if (name.find('.') == std::string::npos && name.find('/') == std::string::npos)
    throw_unknown("environment", "surroundings", name,
                  {{std::string("model"), "auto", "skybox", "studio", "FILE.hdr", "FILE.exr"}});
  throw ValueError(
      fmt::format("environment '{:.300}': only pictures of type .hdr and .exr are read", name));
}

}  // namespace

// Null arrays: the model is of a version of MuJoCo without image lights.
int image_light_of(const mjModel* m) {
  if (!m->light_type || !m->light_texid || !m->light_active) return -1;
  for (int i = 0; i < m->nlight; ++i) {
    const int id = m->light_texid[i];
    if (m->light_type[i] == mjLIGHT_IMAGE && m->light_active[i] && id >= 0 && id < m->ntex &&
        m->tex_type[id] != mjTEXTURE_2D && is_color(m, id))
      return i;
  }
  return -1;
}

std::shared_ptr<const Environment> prepared(EnvironmentImage image) {
  normalize(image);
  auto made = std::make_shared<Environment>();
  project(image, made->light.irradiance);
  prefilter(image, *made);
  return made;
}

std::shared_ptr<const Environment> environment(const mjModel* model, const std::string& name) {
  if (is_environment_file(name)) {
    const std::string bytes = read_environment_file(name);
    return prepared_sources().get(ContentKey().add(std::span<const char>(bytes)),
                                  [&] { return prepared(parse_environment(name, bytes)); });
  }
  if (name == "studio") return studio();
  if (name != "auto" && name != "model" && name != "skybox") throw_no_environment(name);
  if (const int light = name == "skybox" ? -1 : image_light_of(model); light >= 0)
    return of_texture(model, model->light_texid[light]);
  if (name == "model") return studio();
  if (const int sky = skybox_of(model); sky >= 0) return of_texture(model, sky);
  if (name == "auto") return studio();
  throw ValueError(
      "environment 'skybox': the model has no skybox texture; use 'studio' or an .hdr file");
}

}  // namespace mjsense::render
