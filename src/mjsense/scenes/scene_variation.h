// SPDX-License-Identifier: Apache-2.0
#pragma once
// What is different in every episode: lights, colours, textures and where furniture stands, written
// to the world's own model, so that nothing is compiled again.

#include <cstdint>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/scenes/scene_file.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {

class SceneVariation {
 public:
  // Throws KeyError for a pattern that matches nothing and for a texture that there is not, ValueError for a body that
  // moves; `place` starts its message.
  SceneVariation(std::vector<SceneVaryCfg> cfg, Simulation& simulation, std::string_view place);

  bool varies() const { return !parts_.empty(); }
  // This world's body_pos; the model's where no body stands anywhere else.
  const double* body_pos(int world) const;
  // Writes this world's rows of the model; Worlds::model_changed() and forward() follow.
  void vary(int world, Rng& rng) const;

 private:
  struct Part {
    SceneVaryCfg cfg;
    std::vector<int> ids, textures;
  };
  float* colour_of(VaryKind what, int world, int id) const;
  void move_body(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const;

  std::vector<Part> parts_;
  const mjModel* model_;
  // [B, n, ...] of MuJoCo's batch; null where nothing varies.
  double *light_pos_ = nullptr, *light_dir_ = nullptr, *body_pos_ = nullptr, *body_quat_ = nullptr;
  float *light_diffuse_ = nullptr, *mat_rgba_ = nullptr, *geom_rgba_ = nullptr;
  int* mat_texid_ = nullptr;
};

// A colour with its hue turned (degrees), its saturation shifted, its value scaled; rgb in [0, 1].
void shift_colour(double hue, double saturation, double brightness, float rgb[3]);

}  // namespace mjsense
