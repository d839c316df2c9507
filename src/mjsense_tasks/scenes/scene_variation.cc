// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/scene_variation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "mjsense/core/error.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/backdrop.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::scenes {
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

SceneVariation::SceneVariation(const SceneFileCfg& cfg, sim::Simulation& simulation,
                               std::string_view context)
    : model_(simulation.model()) {
  mjBatch* batch = simulation.worlds().batch();
  for (const SceneMoodCfg& mood : cfg.moods)
    moods_.push_back(
        {mood.name, parts_of(mood.vary, batch, fmt::format("{}, mood '{}'", context, mood.name))});
  parts_ = parts_of(cfg.vary, batch, std::string(context));
}

std::vector<SceneVariation::Part> SceneVariation::parts_of(const std::vector<SceneVaryCfg>& cfg,
                                                           mjBatch* batch,
                                                           const std::string& context) {
  std::vector<Part> parts;
  for (const SceneVaryCfg& one : cfg) {
    Part part{.cfg = one};
    const mjtObj type = object_type(one.what);
    const std::vector<std::string> names = scene::model_names(model_, type);
    const std::string who = fmt::format("{}, vary {}", context, one.what.text());
    const Regex pattern(one.pattern, who);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (scene::is_of_backdrop(names[i]))
        continue;  // it belongs to the recording, not to the scene
      if (!names[i].empty() && pattern.fullmatch(names[i])) part.ids.push_back(static_cast<int>(i));
    }
    if (part.ids.empty() && one.optional) continue;
    if (part.ids.empty()) throw_unknown(who, one.what.text(), one.pattern, names);
    for (const std::string& texture : one.textures) {
      part.textures.push_back(scene::resolve(model_, mjOBJ_TEXTURE, texture, who));
      part.normals.push_back(mj_name2id(model_, mjOBJ_TEXTURE, (texture + "_normals").c_str()));
    }
    if (!one.shows.empty()) part.shows = scene::resolve(model_, mjOBJ_TEXTURE, one.shows, who);
    const bool colours = changes_colour(one);
    if (colours && one.what == VaryKind::kLight)
      light_diffuse_.expand(batch, "light_diffuse", model_->light_diffuse);
    if (one.tint != std::array<double, 3>{1, 1, 1} && one.what == VaryKind::kLight) {
      light_ambient_.expand(batch, "light_ambient", model_->light_ambient);
      light_specular_.expand(batch, "light_specular", model_->light_specular);
    }
    if (colours && one.what == VaryKind::kMaterial)
      mat_rgba_.expand(batch, "mat_rgba", model_->mat_rgba);
    if (colours && one.what == VaryKind::kGeom)
      geom_rgba_.expand(batch, "geom_rgba", model_->geom_rgba);
    const bool light = one.what == VaryKind::kLight;
    if (light && one.pos != std::array<double, 3>{})
      light_pos_.expand(batch, "light_pos", model_->light_pos);
    if (light && one.angle > 0) light_dir_.expand(batch, "light_dir", model_->light_dir);
    if (one.what == VaryKind::kBody) {
      for (int id : part.ids) {
        // The pose of a mocap body is part of the state.
        if (model_->body_treeid[id] >= 0 || model_->body_mocapid[id] >= 0 || id == 0)
          throw ValueError(fmt::format("{}: body '{}' is not a fixed body", who, names[id]));
      }
      body_pos_.expand(batch, "body_pos", model_->body_pos);
      body_quat_.expand(batch, "body_quat", model_->body_quat);
    }
    if (!part.textures.empty() || part.shows >= 0)
      mat_texid_.expand(batch, "mat_texid", model_->mat_texid);
    parts.push_back(std::move(part));
  }
  return parts;
}

void SceneVariation::reset(int world) const {
  light_pos_.reset(world);
  light_dir_.reset(world);
  light_ambient_.reset(world);
  light_diffuse_.reset(world);
  light_specular_.reset(world);
  mat_rgba_.reset(world);
  mat_texid_.reset(world);
  geom_rgba_.reset(world);
}

void SceneVariation::recolour(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const {
  const double brightness = rng.uniform(cfg.brightness[0], cfg.brightness[1]);
  const double hue = around(rng, cfg.hue), saturation = around(rng, cfg.saturation);
  const auto tint = [&](const WorldField<float>& field, int size) -> float* {
    if (!field) return nullptr;
    float* rgb = field.of(world) + size * id;
    for (int i = 0; i < 3; ++i) rgb[i] *= static_cast<float>(cfg.tint[i]);
    return rgb;
  };
  float* rgb = nullptr;
  if (cfg.what == VaryKind::kLight) {
    tint(light_ambient_, 3);
    tint(light_specular_, 3);
    rgb = tint(light_diffuse_, 3);
  } else {
    rgb = tint(cfg.what == VaryKind::kMaterial ? mat_rgba_ : geom_rgba_, 4);
  }
  if (rgb) shift_colour(hue, saturation, brightness, rgb);
}

const double* SceneVariation::body_pos(int world) const {
  return body_pos_ ? body_pos_.of(world) : model_->body_pos;
}

void SceneVariation::move_body(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const {
  double* pos = body_pos_.of(world) + 3 * id;
  for (int i = 0; i < 3; ++i) pos[i] = model_->body_pos[3 * id + i] + around(rng, cfg.pos[i]);
  const double turn = around(rng, cfg.angle) * std::numbers::pi / 180;
  write_quat(axis_angle({0, 0, 1}, turn) * quat(model_->body_quat + 4 * id),
             body_quat_.of(world) + 4 * id);
}

void SceneVariation::apply(const Part& part, int world, Rng& episode_rng) const {
  const SceneVaryCfg& c = part.cfg;
  for (int id : part.ids) {
    // Image lights draw numbers of their own: classic images, which do not have them, stay the same.
    const bool image_light = c.what == VaryKind::kLight && model_->light_type[id] == mjLIGHT_IMAGE;
    Rng own = episode_rng;
    Rng& rng = image_light ? own : episode_rng;
    if (c.what == VaryKind::kBody) {
      move_body(c, world, id, rng);
      continue;
    }
    recolour(c, world, id, rng);
    if (c.what == VaryKind::kLight) {
      for (int i = 0; i < 3 && light_pos_; ++i)
        light_pos_.of(world)[3 * id + i] += around(rng, c.pos[i]);
      if (light_dir_ && c.angle > 0) {
        double* direction = light_dir_.of(world) + 3 * id;
        write_vec(turned(vec3(direction), c.angle * std::numbers::pi / 180, rng), direction);
      }
    }
    if (!part.textures.empty()) {
      const auto drawn = rng.below(static_cast<std::uint32_t>(part.textures.size()));
      int* roles = mat_texid_.of(world) + mjNTEXROLE * id;
      roles[mjTEXROLE_RGB] = part.textures[drawn];
      roles[mjTEXROLE_NORMAL] = part.normals[drawn];
    }
    if (part.shows >= 0) mat_texid_.of(world)[mjNTEXROLE * id + mjTEXROLE_EMISSIVE] = part.shows;
  }
}

const SceneVariation::Mood& SceneVariation::drawn_mood(Rng& rng) const {
  return moods_[rng.below(static_cast<std::uint32_t>(moods_.size()))];
}

std::string SceneVariation::mood(Rng rng) const {
  return moods_.empty() ? std::string() : drawn_mood(rng).name;
}

void SceneVariation::vary(int world, Rng& rng) const {
  reset(world);
  if (!moods_.empty()) {
    for (const Part& part : drawn_mood(rng).parts) apply(part, world, rng);
  }
  for (const Part& part : parts_) apply(part, world, rng);
}

}  // namespace mjsense::tasks::scenes
