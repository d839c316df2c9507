// SPDX-License-Identifier: Apache-2.0
#pragma once
// Randomisation of lights, colours, textures and furniture positions per episode. It writes to each
// world's own model fields, so that no recompilation is needed.

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/scenes/scene_file.h"
#include "mjsense_tasks/scenes/world_field.h"

namespace mjsense::tasks::scenes {

class SceneVariation {
 public:
  // Throws KeyError for a pattern that matches nothing or an unknown texture, and ValueError for a
  // body that moves. `context` is the prefix of messages.
  SceneVariation(const SceneFileCfg& cfg, sim::Simulation& simulation, std::string_view context);

  // body_pos of this world; the model's own array if body positions do not vary.
  const double* body_pos(int world) const;
  // Writes this world's rows of the model. Call Worlds::model_changed() and forward() afterwards.
  void vary(int world, Rng& rng) const;
  // Name of the mood that vary() applies for the same random numbers; empty without moods.
  std::string mood(Rng rng) const;

 private:
  struct Part {
    SceneVaryCfg cfg;
    std::vector<int> ids, textures, normals;  // normals: of the textures; -1: none
    int shows = -1;
  };
  struct Mood {
    std::string name;
    std::vector<Part> parts;
  };
  const Mood& drawn_mood(Rng& rng) const;
  std::vector<Part> parts_of(const std::vector<SceneVaryCfg>& cfg, mjBatch* batch,
                             const std::string& context);
  // Gives this world's rows the model's values, except those of bodies.
  void reset(int world) const;
  void apply(const Part& part, int world, Rng& rng) const;
  void recolour(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const;
  void move_body(const SceneVaryCfg& cfg, int world, int id, Rng& rng) const;

  std::vector<Part> parts_;
  std::vector<Mood> moods_;
  const mjModel* model_;
  // Fields that do not vary are empty.
  WorldField<double> light_pos_, light_dir_, body_pos_, body_quat_;
  WorldField<float> light_ambient_, light_diffuse_, light_specular_, mat_rgba_, geom_rgba_;
  WorldField<int> mat_texid_;
};

// Rotates the hue (degrees), shifts the saturation and scales the value (brightness) of a colour;
// rgb in [0, 1].
void shift_colour(double hue, double saturation, double brightness, float rgb[3]);

}  // namespace mjsense::tasks::scenes
