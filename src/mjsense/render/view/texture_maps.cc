// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/texture_maps.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"

namespace mjsense::render {

void check_texture_maps(const mjModel* m) {
  constexpr const char* kNames[kNumTextureMaps] = {"occlusion", "roughness", "metallic", "normal",
                                                   "opacity",   "emissive",  "orm"};
  for (int material = 0; material < m->nmat; ++material) {
    const TextureIds ids = textures_of(m, material);
    for (int map = 0; map < kNumTextureMaps; ++map) {
      const int id = texture_of(ids, static_cast<TextureMap>(map));
      if (id < 0) continue;
      const bool colored = map == kNormalMap || map == kEmissiveMap || map == kOrmMap;
      const auto fail = [&](const std::string& why) {
        const auto name = [&](int type, int of, int address) {
          return m->names ? m->names + address : fmt::format("{} {}", mju_type2Str(type), of);
        };
        throw ValueError(fmt::format(
            "material '{}': its texture '{}' for the role {} {}",
            name(mjOBJ_MATERIAL, material, m->names ? m->name_matadr[material] : 0),
            name(mjOBJ_TEXTURE, id, m->names ? m->name_texadr[id] : 0), kNames[map], why));
      };
      if (m->tex_type[id] != mjTEXTURE_2D) fail("is a cube map; it must be of type 2d");
      const int channels = m->tex_nchannel[id];
      if (channels == 2 || (colored && channels < 3))
        fail(fmt::format("has {}; it must have 3 or 4{}", counted(channels, "channel"),
                         colored ? "" : ", or 1"));
    }
  }
}

}  // namespace mjsense::render
