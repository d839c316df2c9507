// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/scene_variation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "mjsense/core/error.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scenes {
namespace {

mjtObj object_type(VaryKind what) {
  switch (what) {
    case VaryKind::kLight:
      return mjOBJ_LIGHT;
    case VaryKind::kMaterial:
      return mjOBJ_MATERIAL;
    case VaryKind::kBody:
      return mjOBJ_BODY;
    case VaryKind::kGeom:
      break;
  }
  return mjOBJ_GEOM;
}

// Makes the field `field` of the batch's model an array with rows per world. The values are
// unchanged.
template <class T>
T* expand(mjBatch* batch, const char* field, T* before) {
  return before ? before : static_cast<T*>(mjb_expand(batch, field, nullptr, nullptr));
}

double around(Rng& rng, double half) { return half > 0 ? rng.uniform(-half, half) : 0.0; }

// Rotates a direction by at most `maximum` rad; uniform within the cone.
Vec3 turned(Vec3 axis, double maximum, Rng& rng) {
  const double cosine = rng.uniform(std::cos(maximum), 1.0),
               angle = rng.uniform(0, 2 * std::numbers::pi);
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  axis = normalized(axis);
  const Vec3 side = normalized(cross(axis, std::abs(axis.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  return cosine * axis + sine * std::cos(angle) * side + sine * std::sin(angle) * cross(axis, side);
}

}  // namespace

void shift_colour(double hue, double saturation, double brightness, float rgb[3]) {
  const double r = rgb[0], g = rgb[1], b = rgb[2];
  const double high = std::max({r, g, b}), chroma = high - std::min({r, g, b});
  double h = 0;
  if (chroma > 0) {
    h = high == r ? (g - b) / chroma : high == g ? 2 + (b - r) / chroma : 4 + (r - g) / chroma;
  }
  h = 60 * h + hue;
  const double s = std::clamp((high > 0 ? chroma / high : 0.0) + saturation, 0.0, 1.0);
  const double v = std::clamp(high * brightness, 0.0, 1.0);
  // A grey has no hue, so its saturation is not changed.
  const double strength = chroma > 0 ? s : 0.0;
  const double offsets[3] = {5, 3, 1};
  for (int i = 0; i < 3; ++i) {
    double k = std::fmod(offsets[i] + h / 60, 6);
    if (k < 0) k += 6;
    rgb[i] = static_cast<float>(v - v * strength * std::max(0.0, std::min({k, 4 - k, 1.0})));
  }
}

SceneVariation::SceneVariation(std::vector<SceneVaryCfg> cfg, sim::Simulation& simulation,
                               std::string_view context)
    : model_(simulation.model()) {
  mjBatch* batch = simulation.worlds().batch();
  for (SceneVaryCfg& one : cfg) {
    Part part;
    const mjtObj type = object_type(one.what);
    const std::vector<std::string> names = scene::model_names(model_, type);
    const std::string who = fmt::format("{}, vary {}", context, one.what.text());
    const Regex pattern(one.pattern, who);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!names[i].empty() && pattern.fullmatch(names[i])) part.ids.push_back(static_cast<int>(i));
    }
    if (part.ids.empty()) throw_unknown(who, one.what.text(), one.pattern, names);
    for (const std::string& texture : one.textures)
      part.textures.push_back(scene::resolve(model_, mjOBJ_TEXTURE, texture, who));
    const bool colours =
        one.brightness != std::array<double, 2>{1, 1} || one.hue > 0 || one.saturation > 0;
    if (colours && one.what == VaryKind::kLight)
      light_diffuse_ = expand(batch, "light_diffuse", light_diffuse_);
    if (colours && one.what == VaryKind::kMaterial)
      mat_rgba_ = expand(batch, "mat_rgba", mat_rgba_);
    if (colours && one.what == VaryKind::kGeom) geom_rgba_ = expand(batch, "geom_rgba", geom_rgba_);
    const bool light = one.what == VaryKind::kLight;
    if (light && one.pos != std::array<double, 3>{})
      light_pos_ = expand(batch, "light_pos", light_pos_);
    if (light && one.angle > 0) light_dir_ = expand(batch, "light_dir", light_dir_);
    if (one.what == VaryKind::kBody) {
      for (int id : part.ids) {
        // The pose of a mocap body is part of the state.
        if (model_->body_treeid[id] >= 0 || model_->body_mocapid[id] >= 0 || id == 0)
          throw ValueError(fmt::format("{}: body '{}' is not a fixed body", who, names[id]));
      }
      body_pos_ = expand(batch, "body_pos", body_pos_);
      body_quat_ = expand(batch, "body_quat", body_quat_);
    }
    if (!part.textures.empty()) mat_texid_ = expand(batch, "mat_texid", mat_texid_);
    part.cfg = std::move(one);
    parts_.push_back(std::move(part));
  }
}

// Resets this world's row to the model's colour and returns it; null if colours of this kind do not
// vary.
float* SceneVariation::colour_of(VaryKind what, int world, int id) const {
  const auto row = [&](float* base, int count, int size, const float* rest) -> float* {
    if (!base) return nullptr;
    float* mine = base + (static_cast<std::size_t>(world) * count + id) * size;
    std::copy_n(rest + static_cast<std::ptrdiff_t>(id) * size, size, mine);
    return mine;
  };
  switch (what) {
    case VaryKind::kLight:
      return row(light_diffuse_, static_cast<int>(model_->nlight), 3, model_->light_diffuse);
    case VaryKind::kMaterial:
      return row(mat_rgba_, static_cast<int>(model_->nmat), 4, model_->mat_rgba);
    case VaryKind::kBody:
      return nullptr;
    case VaryKind::kGeom:
      break;
  }
  return row(geom_rgba_, static_cast<int>(model_->ngeom), 4, model_->geom_rgba);
}

const double* SceneVariation::body_pos(int world) const {
  return body_pos_ ? body_pos_ + 3 * static_cast<std::size_t>(world) * model_->nbody
                   : model_->body_pos;
}

void SceneVariation::move_body(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const {
  const std::size_t at = static_cast<std::size_t>(world) * model_->nbody + id;
  for (int i = 0; i < 3; ++i)
    body_pos_[3 * at + i] = model_->body_pos[3 * id + i] + around(rng, cfg.pos[i]);
  const double turn = around(rng, cfg.angle) * std::numbers::pi / 180;
  write_quat(axis_angle({0, 0, 1}, turn) * quat(model_->body_quat + 4 * id), body_quat_ + 4 * at);
}

void SceneVariation::vary(int world, Rng& rng) const {
  for (const Part& part : parts_) {
    const SceneVaryCfg& c = part.cfg;
    for (int id : part.ids) {
      if (c.what == VaryKind::kBody) {
        move_body(c, world, id, rng);
        continue;
      }
      const double brightness = rng.uniform(c.brightness[0], c.brightness[1]);
      const double hue = around(rng, c.hue), saturation = around(rng, c.saturation);
      if (float* rgb = colour_of(c.what, world, id)) shift_colour(hue, saturation, brightness, rgb);
      if (c.what == VaryKind::kLight) {
        const std::size_t at = 3 * (static_cast<std::size_t>(world) * model_->nlight + id);
        if (light_pos_) {
          for (int i = 0; i < 3; ++i)
            light_pos_[at + i] = model_->light_pos[3 * id + i] + around(rng, c.pos[i]);
        }
        if (light_dir_ && c.angle > 0) {
          const Vec3 dir =
              turned(vec3(model_->light_dir + 3 * id), c.angle * std::numbers::pi / 180, rng);
          write_vec(dir, light_dir_ + at);
        }
      }
      if (!part.textures.empty()) {
        const std::size_t at =
            mjNTEXROLE * (static_cast<std::size_t>(world) * model_->nmat + id) + mjTEXROLE_RGB;
        mat_texid_[at] = part.textures[rng.below(static_cast<std::uint32_t>(part.textures.size()))];
      }
    }
  }
}

}  // namespace mjsense::scenes
