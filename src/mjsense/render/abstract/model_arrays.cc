// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/model_arrays.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <type_traits>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"

namespace mjsense::render {
namespace {

// Reads fields of `arrays` into an mjModel.
class FieldReader {
 public:
  FieldReader(const NamedArrays& arrays, mjModel* model) : arrays_(arrays), model_(model) {}

  // The array `name` with `columns` values per row (0: any number, for arrays by one index) and, if
  // `rows` is not negative, with this number of rows. Returns its number of rows.
  template <class T>
  std::int64_t read(const char* name, T* mjModel::*field, std::int64_t columns,
                    std::int64_t rows = -1) {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) throw ValueError(fmt::format("the model has no field '{}'", name));
    const NamedArray& array = found->second;
    const char kind = std::is_floating_point_v<T> ? 'f' : 'i';
    const bool byte = sizeof(T) == 1 && array.bytes == 1;
    if (!byte && (array.kind != kind || array.bytes != static_cast<int>(sizeof(T))))
      throw ValueError(
          fmt::format("the model's field '{}' has elements of type {}{}, expected {}{}", name,
                      array.kind, array.bytes, kind, sizeof(T)));
    std::int64_t size = 1, expected = columns == 0 ? 1 : columns;
    for (std::int64_t n : array.shape) size *= n;
    // A model stores some rows of three as a flat array, others as [n, 3].
    const std::int64_t found_rows = array.shape.size() > 1 ? array.rows() : size / expected;
    if (size != found_rows * expected || (rows >= 0 && found_rows != rows))
      throw ValueError(fmt::format("the model's field '{}' has shape [{}], expected [{}, {}]", name,
                                   fmt::join(array.shape, ", "),
                                   rows >= 0 ? std::to_string(rows) : "n", expected));
    model_->*field = static_cast<T*>(array.data);
    return found_rows;
  }

  bool has(const char* name) const { return arrays_.contains(name); }

 private:
  const NamedArrays& arrays_;
  mjModel* model_;
};

// Arrays with a row for each element that are not ids.
struct ElementField {
  const char* name;
  int* mjModel::*field;
  mjtSize mjModel::*rows;
};
#define MJSENSE_ELEMENT(name, rows) {#name, &mjModel::name, &mjModel::rows},
constexpr ElementField kElementFields[] = {
    // clang-format off
    MJSENSE_ELEMENT(body_jntadr, nbody)
    MJSENSE_ELEMENT(body_jntnum, nbody)
    MJSENSE_ELEMENT(body_geomadr, nbody)
    MJSENSE_ELEMENT(body_geomnum, nbody)
    MJSENSE_ELEMENT(jnt_type, njnt)
    MJSENSE_ELEMENT(geom_type, ngeom)
    MJSENSE_ELEMENT(geom_dataid, ngeom)
    MJSENSE_ELEMENT(site_type, nsite)
    MJSENSE_ELEMENT(cam_mode, ncam)
    MJSENSE_ELEMENT(light_mode, nlight)
    MJSENSE_ELEMENT(light_type, nlight)
    MJSENSE_ELEMENT(skin_boneadr, nskin)
    MJSENSE_ELEMENT(skin_bonenum, nskin)
    // clang-format on
};
#undef MJSENSE_ELEMENT

}  // namespace

// An array of another type is left out: it belongs to a version of MuJoCo that uses it for something
// else.
std::unique_ptr<mjModel> indices_of_arrays(const NamedArrays& arrays, const mjModel& drawn) {
  auto model = std::make_unique<mjModel>(drawn);
  FieldReader fields(arrays, model.get());
  mjModel& m = *model;
  m.ncam = 0;
  const auto usable = [&](const std::string& name) {
    const auto found = arrays.find(name);
    return found != arrays.end() && found->second.kind == 'i' && found->second.bytes == sizeof(int);
  };
  for (const ElementField& f : kElementFields)
    if (usable(f.name)) m.*f.rows = fields.read(f.name, f.field, 0);
  for (const IdField& f : drawn_id_fields())
    if (!(m.*f.ids) && usable(f.name)) m.*f.rows = fields.read(f.name.c_str(), f.ids, 0);
  check_element_indices(m);
  return model;
}

std::vector<std::string> scene_index_fields() {
  std::vector<std::string> names;
  for (const ElementField& f : kElementFields) names.emplace_back(f.name);
  for (const IdField& f : drawn_id_fields()) names.push_back(f.name);
  return names;
}

#define MJSENSE_READ(name, ...) fields.read(#name, &mjModel::name, __VA_ARGS__)

std::unique_ptr<mjModel> model_of_arrays(const NamedArrays& arrays) {
  auto model = std::make_unique<mjModel>();
  FieldReader fields(arrays, model.get());
  mjModel& m = *model;
  m.ncam = 1;  // so that shapes are prepared for images

  m.nmesh = MJSENSE_READ(mesh_vertadr, 0);
  MJSENSE_READ(mesh_vertnum, 0, m.nmesh);
  MJSENSE_READ(mesh_faceadr, 0, m.nmesh);
  MJSENSE_READ(mesh_facenum, 0, m.nmesh);
  MJSENSE_READ(mesh_normaladr, 0, m.nmesh);
  MJSENSE_READ(mesh_normalnum, 0, m.nmesh);
  MJSENSE_READ(mesh_texcoordadr, 0, m.nmesh);
  MJSENSE_READ(mesh_texcoordnum, 0, m.nmesh);
  MJSENSE_READ(mesh_graphadr, 0, m.nmesh);
  m.nmeshvert = MJSENSE_READ(mesh_vert, 3);
  m.nmeshnormal = MJSENSE_READ(mesh_normal, 3);
  m.nmeshtexcoord = MJSENSE_READ(mesh_texcoord, 2);
  const std::int64_t faces = m.nmeshface = MJSENSE_READ(mesh_face, 3);
  MJSENSE_READ(mesh_facenormal, 3, faces);
  MJSENSE_READ(mesh_facetexcoord, 3, faces);
  m.nmeshgraph = MJSENSE_READ(mesh_graph, 0);

  m.nhfield = MJSENSE_READ(hfield_adr, 0);
  MJSENSE_READ(hfield_nrow, 0, m.nhfield);
  MJSENSE_READ(hfield_ncol, 0, m.nhfield);
  MJSENSE_READ(hfield_size, 4, m.nhfield);
  m.nhfielddata = MJSENSE_READ(hfield_data, 0);

  m.nskin = MJSENSE_READ(skin_vertadr, 0);
  MJSENSE_READ(skin_vertnum, 0, m.nskin);
  MJSENSE_READ(skin_texcoordadr, 0, m.nskin);
  MJSENSE_READ(skin_faceadr, 0, m.nskin);
  MJSENSE_READ(skin_facenum, 0, m.nskin);
  m.nskinvert = MJSENSE_READ(skin_vert, 3);
  m.nskintexvert = MJSENSE_READ(skin_texcoord, 2);
  m.nskinface = MJSENSE_READ(skin_face, 3);

  m.ntex = MJSENSE_READ(tex_adr, 0);
  MJSENSE_READ(tex_type, 0, m.ntex);
  MJSENSE_READ(tex_width, 0, m.ntex);
  MJSENSE_READ(tex_height, 0, m.ntex);
  MJSENSE_READ(tex_nchannel, 0, m.ntex);
  if (fields.has("tex_colorspace")) MJSENSE_READ(tex_colorspace, 0, m.ntex);
  m.ntexdata = MJSENSE_READ(tex_data, 0);

  if (fields.has("light_type") && fields.has("light_texid")) {  // for image lights
    m.nlight = MJSENSE_READ(light_type, 0);
    MJSENSE_READ(light_texid, 0, m.nlight);
    MJSENSE_READ(light_active, 0, m.nlight);
  }

  m.nmat = MJSENSE_READ(mat_texid, mjNTEXROLE);
  MJSENSE_READ(mat_texuniform, 0, m.nmat);
  MJSENSE_READ(mat_texrepeat, 2, m.nmat);
  if (fields.has("mat_metallic")) MJSENSE_READ(mat_metallic, 0, m.nmat);
  if (fields.has("mat_roughness")) MJSENSE_READ(mat_roughness, 0, m.nmat);
  return model;
}

#undef MJSENSE_READ

}  // namespace mjsense::render
