// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/abstract_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mjsense/core/error.h"

namespace mjsense::render {

// Name, place and size of a member.
#define MJSENSE_FIELD(type, name, integer, needed) \
  { #name, offsetof(type, name), sizeof(type::name), integer, needed }

StructReader StructReader::geoms(const StructLayout& layout) {
  using G = AbstractGeom;
  const Wanted fields[] = {
      MJSENSE_FIELD(G, type, true, true),         MJSENSE_FIELD(G, dataid, true, true),
      MJSENSE_FIELD(G, objtype, true, true),      MJSENSE_FIELD(G, objid, true, true),
      MJSENSE_FIELD(G, category, true, true),     MJSENSE_FIELD(G, matid, true, true),
      MJSENSE_FIELD(G, texcoord, true, false),    MJSENSE_FIELD(G, segid, true, true),
      MJSENSE_FIELD(G, texid, true, false),       MJSENSE_FIELD(G, texuniform, true, false),
      MJSENSE_FIELD(G, texrepeat, false, false),  MJSENSE_FIELD(G, size, false, true),
      MJSENSE_FIELD(G, pos, false, true),         MJSENSE_FIELD(G, mat, false, true),
      MJSENSE_FIELD(G, rgba, false, true),        MJSENSE_FIELD(G, emission, false, true),
      MJSENSE_FIELD(G, specular, false, true),    MJSENSE_FIELD(G, shininess, false, true),
      MJSENSE_FIELD(G, reflectance, false, true), MJSENSE_FIELD(G, label, false, true),
  };
  return {"MjvGeom", layout, fields};
}

StructReader StructReader::lights(const StructLayout& layout) {
  using L = AbstractLight;
  const Wanted fields[] = {
      MJSENSE_FIELD(L, type, true, false),        MJSENSE_FIELD(L, directional, true, false),
      MJSENSE_FIELD(L, castshadow, true, true),   MJSENSE_FIELD(L, pos, false, true),
      MJSENSE_FIELD(L, dir, false, true),         MJSENSE_FIELD(L, ambient, false, true),
      MJSENSE_FIELD(L, diffuse, false, true),     MJSENSE_FIELD(L, specular, false, true),
      MJSENSE_FIELD(L, attenuation, false, true), MJSENSE_FIELD(L, cutoff, false, true),
      MJSENSE_FIELD(L, exponent, false, true),    MJSENSE_FIELD(L, intensity, false, false),
      MJSENSE_FIELD(L, range, false, false),      MJSENSE_FIELD(L, bulbradius, false, false),
  };
  if (!layout.contains("type") && !layout.contains("directional"))
    throw ValueError("MjvLight of this MuJoCo has neither the field 'type' nor 'directional'");
  return {"MjvLight", layout, fields};
}

StructReader StructReader::cameras(const StructLayout& layout) {
  using C = AbstractCamera;
  const Wanted fields[] = {
      MJSENSE_FIELD(C, pos, false, true),
      MJSENSE_FIELD(C, forward, false, true),
      MJSENSE_FIELD(C, up, false, true),
      MJSENSE_FIELD(C, frustum_center, false, true),
      MJSENSE_FIELD(C, frustum_width, false, false),
      MJSENSE_FIELD(C, frustum_bottom, false, true),
      MJSENSE_FIELD(C, frustum_top, false, true),
      MJSENSE_FIELD(C, frustum_near, false, true),
      MJSENSE_FIELD(C, frustum_far, false, true),
      MJSENSE_FIELD(C, orthographic, true, false),
  };
  return {"MjvGLCamera", layout, fields};
}

#undef MJSENSE_FIELD

bool is_finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float x) { return std::isfinite(x); });
}

StructReader::StructReader(const char* type, const StructLayout& layout,
                           std::span<const Wanted> fields) {
  for (const Wanted& field : fields) {
    const auto found = layout.find(field.name);
    if (found == layout.end()) {
      if (field.needed)
        throw ValueError(fmt::format(
            "{} of this MuJoCo has no field '{}', which is needed to draw it", type, field.name));
      continue;
    }
    const FieldPlace& place = found->second;
    const bool widen = field.integer && place.bytes == 1;
    if (!widen && place.bytes != field.bytes)
      throw ValueError(fmt::format("{}.{} of this MuJoCo has {} bytes, expected {}", type,
                                   field.name, place.bytes, field.bytes));
    steps_.push_back({place.offset, field.to, field.bytes, widen});
  }
}

void StructReader::copy(const char* from, char* to) const {
  for (const Step& step : steps_) {
    if (step.widen) {
      const int value = static_cast<unsigned char>(from[step.from]);
      std::memcpy(to + step.to, &value, sizeof value);
    } else {
      std::memcpy(to + step.to, from + step.from, step.bytes);
    }
  }
}

}  // namespace mjsense::render
