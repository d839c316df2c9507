// SPDX-License-Identifier: Apache-2.0
#pragma once
// One world's values of all model fields that affect an image.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstring>
#include <vector>

namespace mjsense::render {

class VisualFields {
 public:
  explicit VisualFields(const mjModel* model) {
    std::size_t bytes = 0;
    for_each(model, [&](const void*, std::size_t size) { bytes += size; });
    values_.resize(bytes);
    copy_from(model);
  }
  // No allocation.
  void copy_from(const mjModel* model) {
    char* at = values_.data();
    for_each(model, [&](const void* field, std::size_t size) {
      if (size > 0) std::memcpy(at, field, size);
      at += size;
    });
  }
  // `model` must have the same sizes as the constructor's.
  void copy_to(mjModel* model) const {
    const char* at = values_.data();
    for_each(model, [&](void* field, std::size_t size) {
      if (size > 0) std::memcpy(field, at, size);
      at += size;
    });
  }

 private:
  // Calls use(field, bytes) for every such field; Model is mjModel or const mjModel.
  template <class Model, class Use>
  static void for_each(Model* m, Use&& use) {
    const auto fields = [&](std::size_t count, auto*... field) {
      (use(field, count * sizeof(*field)), ...);
    };
    fields(m->ngeom, m->geom_type, m->geom_dataid, m->geom_matid, m->geom_group);
    fields(3 * m->ngeom, m->geom_size);
    fields(4 * m->ngeom, m->geom_rgba);
    fields(m->ngeom, m->geom_rbound);
    fields(m->nflex, m->flex_group, m->flex_radius, m->flex_flatskin);
    fields(m->nflexelem, m->flex_matid);
    fields(4 * m->nflex, m->flex_rgba);
    fields(m->nskin, m->skin_matid, m->skin_group, m->skin_inflate);
    fields(4 * m->nskin, m->skin_rgba);
    fields(m->nmat, m->mat_texuniform, m->mat_emission, m->mat_specular, m->mat_shininess,
           m->mat_reflectance);
    fields(mjNTEXROLE * m->nmat, m->mat_texid);
    fields(2 * m->nmat, m->mat_texrepeat);
    fields(4 * m->nmat, m->mat_rgba);
    fields(m->nlight, m->light_type, m->light_castshadow, m->light_active, m->light_cutoff,
           m->light_exponent, m->light_range, m->light_bulbradius);
    fields(3 * m->nlight, m->light_attenuation, m->light_ambient, m->light_diffuse,
           m->light_specular);
    fields(m->ncam, m->cam_projection, m->cam_fovy);
    fields(2 * m->ncam, m->cam_sensorsize);
    fields(4 * m->ncam, m->cam_intrinsic);
  }

  std::vector<char> values_;
};

}  // namespace mjsense::render
