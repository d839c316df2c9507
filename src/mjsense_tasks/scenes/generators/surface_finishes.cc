// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr Colour kWoods[] = {{0.72, 0.55, 0.38},
                             {0.62, 0.44, 0.28},
                             {0.80, 0.66, 0.48},
                             {0.47, 0.33, 0.22},
                             {0.68, 0.57, 0.45}};
constexpr Colour kPaints[] = {{0.90, 0.89, 0.86}, {0.34, 0.42, 0.40}, {0.30, 0.36, 0.46},
                              {0.62, 0.66, 0.60}, {0.75, 0.70, 0.62}, {0.86, 0.83, 0.76}};
constexpr Colour kWalls[] = {{0.88, 0.87, 0.83},
                             {0.80, 0.84, 0.84},
                             {0.86, 0.82, 0.74},
                             {0.78, 0.82, 0.76},
                             {0.87, 0.84, 0.85}};
constexpr Colour kTiles[] = {{0.72, 0.70, 0.66}, {0.55, 0.55, 0.55}, {0.70, 0.62, 0.54}};

}  // namespace

Colour pick(Rng& rng, std::span<const Colour> colours) {
  return colours[rng.below(static_cast<std::uint32_t>(colours.size()))];
}

// The compiler chooses the order in which arguments are evaluated, and compilers for different CPUs
// choose differently: each statement draws one random number, here and in the generators.
Colour wood_colour(Rng& rng) {
  const double brightness = rng.uniform(0.9, 1.1);
  return brighter(pick(rng, kWoods), brightness);
}
Colour paint_colour(Rng& rng) {
  const double brightness = rng.uniform(0.92, 1.06);
  return brighter(pick(rng, kPaints), brightness);
}

void write_shell_finishes(RoomWriter& room, Rng& rng) {
  if (rng.below(3) > 0) {
    const auto planks = rng.next();
    room.tiled("floor", planks_picture(brighter(wood_colour(rng), 0.85), 8, planks), 1.2,
               {.specular = 0.15, .shininess = 0.3, .reflectance = 0.04, .roughness = 0.5});
  } else {
    const Colour tile = pick(rng, kTiles);
    room.tiled("floor", tiles_picture(tile, brighter(tile, 0.7), 3, false, rng.next()), 1.2,
               {.specular = 0.2, .shininess = 0.4, .reflectance = 0.05, .roughness = 0.35});
  }
  const Colour wall = pick(rng, kWalls);
  room.tiled("wall", plaster_picture(wall, rng.next()), 1.5, {.specular = 0.03, .shininess = 0.05});
  room.tiled("ceiling", plaster_picture({0.93, 0.93, 0.92}, rng.next()), 1.5,
             {.specular = 0.0, .shininess = 0.05});
  room.plain("skirting", {0.92, 0.92, 0.90},
             {.specular = 0.15, .shininess = 0.3, .roughness = 0.5});
  room.glowing("lamp_glass", {1.0, 0.98, 0.92}, 0.9);
  for (const auto& [name, look] :
       {std::pair{"outdoors", Outdoors{{0.62, 0.80, 1.0}, {0.95, 0.98, 1.0}, {0.52, 0.60, 0.42}}},
        std::pair{"outdoors_evening",
                  Outdoors{{0.50, 0.52, 0.66}, {1.0, 0.72, 0.45}, {0.25, 0.22, 0.20}}},
        std::pair{"outdoors_night",
                  Outdoors{{0.03, 0.04, 0.08}, {0.06, 0.07, 0.11}, {0.015, 0.02, 0.02}}}})
    room.texture(name, outdoors_picture(look), false);
  room.glowing("window_pane", {0.25, 0.28, 0.31}, 2.2, "outdoors");
}

}  // namespace mjsense::tasks::scenes
