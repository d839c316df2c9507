// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/final_spec_edits.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "mjsense/scene/default_lighting.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::tasks::scenes {
namespace {

// Built-in robots have contype 2 and conaffinity 1. Third-party scenes contain furniture with
// contype 0 and conaffinity 1, which objects collide with. This makes robots collide with it as
// well.
void let_robots_touch(mjSpec* spec) {
  for (mjsElement* element : scene::spec_elements(spec, mjOBJ_GEOM)) {
    mjsGeom* geom = mjs_asGeom(element);
    if (geom->contype == 0 && (geom->conaffinity & 1) != 0) geom->conaffinity |= 2;
  }
}

void apply_look(mjSpec* spec, const SceneFileCfg& cfg) {
  if (cfg.headlight) {
    auto& light = spec->visual.headlight;
    for (int i = 0; i < 3; ++i) {
      light.ambient[i] = static_cast<float>(cfg.headlight->ambient);
      light.diffuse[i] = static_cast<float>(cfg.headlight->diffuse);
      light.specular[i] = static_cast<float>(cfg.headlight->specular);
    }
  }
  spec->visual.quality.shadowsize = 4096;
  std::optional<SceneSkyCfg> sky = cfg.sky;
  if (!sky && !cfg.generator.empty()) sky.emplace();  // generated rooms have windows
  if (sky) scene::set_sky(spec, "", sky->top, sky->bottom);
}

// If a scene places the robot's pedestal `high` m above the floor, adds a plinth of that height, so
// that the pedestal does not float.
void stand_on_plinth(mjSpec* spec, const std::string& robot, double high) {
  if (high <= 0) return;
  for (mjsElement* element : scene::spec_elements(spec, mjOBJ_GEOM)) {
    const mjsGeom* foot = mjs_asGeom(element);
    mjsBody* base = mjs_getParent(element);
    if (!base->mocap ||
        !std::string_view(mjs_getString(mjs_getName(base->element))).starts_with(robot + "/"))
      continue;
    if (foot->type != mjGEOM_BOX || std::abs(foot->pos[2] - foot->size[2]) > 1e-9) continue;
    mjsGeom* plinth = mjs_addGeom(base, nullptr);
    plinth->type = mjGEOM_BOX;
    const double pos[] = {foot->pos[0], foot->pos[1], -0.5 * high};
    const double size[] = {foot->size[0], foot->size[1], 0.5 * high};
    std::ranges::copy(pos, plinth->pos);
    std::ranges::copy(size, plinth->size);
    plinth->contype = foot->contype;
    plinth->conaffinity = foot->conaffinity;
    plinth->group = foot->group;
    mjs_setString(plinth->material, mjs_getString(foot->material));
  }
}

}  // namespace

void finish_spec(mjSpec* spec, const SceneFileCfg& cfg, const std::string& robot) {
  apply_look(spec, cfg);
  stand_on_plinth(spec, robot, cfg.robot.pos[2]);
  let_robots_touch(spec);
}

}  // namespace mjsense::tasks::scenes
