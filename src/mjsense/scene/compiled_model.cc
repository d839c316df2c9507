// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/compiled_model.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <span>
#include <string_view>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/scene/attach.h"
#include "mjsense/scene/model_check.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

// Types of the elements in an outline.
constexpr mjtObj kOutlined[] = {mjOBJ_BODY, mjOBJ_JOINT,    mjOBJ_GEOM,
                                mjOBJ_SITE, mjOBJ_CAMERA,   mjOBJ_TENDON,
                                mjOBJ_MESH, mjOBJ_ACTUATOR, mjOBJ_SENSOR};
// Types of elements that an outline has only if a sensor adds them.
constexpr mjtObj kOthers[] = {mjOBJ_LIGHT,    mjOBJ_FLEX,     mjOBJ_SKIN, mjOBJ_HFIELD,
                              mjOBJ_TEXTURE,  mjOBJ_MATERIAL, mjOBJ_PAIR, mjOBJ_EXCLUDE,
                              mjOBJ_EQUALITY, mjOBJ_NUMERIC,  mjOBJ_TEXT, mjOBJ_TUPLE,
                              mjOBJ_PLUGIN};

void set_name(mjsElement* element, const mjModel* m, mjtObj type, int id) {
  const std::string name = name_of(m, type, id);
  if (!name.empty()) mjs_setName(element, name.c_str());
}

// Bodies with what they carry. Masses and shapes are arbitrary: nothing is computed with them.
void outline_tree(const mjModel* m, mjSpec* spec) {
  std::vector<mjsBody*> bodies = {mjs_findBody(spec, "world")};
  for (int i = 1; i < m->nbody; ++i) {
    mjsBody* body = mjs_addBody(bodies[m->body_parentid[i]], nullptr);
    set_name(body->element, m, mjOBJ_BODY, i);
    body->explicitinertial = 1;
    body->mass = 1;
    std::fill_n(body->inertia, 3, 1.0);
    bodies.push_back(body);
  }
  for (int i = 0; i < m->njnt; ++i) {
    mjsJoint* joint = mjs_addJoint(bodies[m->jnt_bodyid[i]], nullptr);
    set_name(joint->element, m, mjOBJ_JOINT, i);
    joint->type = static_cast<mjtJoint>(m->jnt_type[i]);
    joint->align = mjALIGNFREE_FALSE;
    joint->limited = m->jnt_limited[i] ? mjLIMITED_TRUE : mjLIMITED_FALSE;
    joint->range[0] = 0;
    joint->range[1] = 1;
  }
  for (int i = 0; i < m->ngeom; ++i) {
    mjsGeom* geom = mjs_addGeom(bodies[m->geom_bodyid[i]], nullptr);
    set_name(geom->element, m, mjOBJ_GEOM, i);
    geom->size[0] = 1;
  }
  for (int i = 0; i < m->nsite; ++i)
    set_name(mjs_addSite(bodies[m->site_bodyid[i]], nullptr)->element, m, mjOBJ_SITE, i);
  for (int i = 0; i < m->ncam; ++i) {
    mjsCamera* camera = mjs_addCamera(bodies[m->cam_bodyid[i]], nullptr);
    set_name(camera->element, m, mjOBJ_CAMERA, i);
    std::copy_n(m->cam_resolution + 2 * i, 2, camera->resolution);
  }
}

// What refers to the tree, with arbitrary targets. All elements of the tree are named.
void outline_rest(const mjModel* m, mjSpec* spec) {
  for (int i = 0; i < m->nmesh; ++i) {
    constexpr float kTetrahedron[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    mjsMesh* mesh = mjs_addMesh(spec, nullptr);
    set_name(mesh->element, m, mjOBJ_MESH, i);
    mjs_setFloat(mesh->uservert, kTetrahedron, std::size(kTetrahedron));
  }
  const std::vector<std::string> joints = spec_names(spec, mjOBJ_JOINT),
                                 sites = spec_names(spec, mjOBJ_SITE),
                                 bodies = spec_names(spec, mjOBJ_BODY);
  for (int i = 0; i < m->ntendon; ++i) {
    mjsTendon* tendon = mjs_addTendon(spec, nullptr);
    set_name(tendon->element, m, mjOBJ_TENDON, i);
    tendon->limited = m->tendon_limited[i] ? mjLIMITED_TRUE : mjLIMITED_FALSE;
    tendon->range[1] = 1;
    const int wrap = m->tendon_adr[i], end = wrap + m->tendon_num[i];
    if (m->wrap_type[wrap] == mjWRAP_JOINT)
      mjs_wrapJoint(tendon, joints[m->wrap_objid[wrap]].c_str(), 1);
    for (int w = wrap, ends = 0; w < end && ends < 2; ++w) {
      if (m->wrap_type[w] != mjWRAP_SITE) continue;
      mjs_wrapSite(tendon, sites[m->wrap_objid[w]].c_str());
      ++ends;
    }
  }
  for (int i = 0; i < m->nactuator; ++i) {
    mjsActuator* actuator = mjs_addActuator(spec, nullptr);
    set_name(actuator->element, m, mjOBJ_ACTUATOR, i);
    actuator->trntype = mjTRN_BODY;
    mjs_setString(actuator->target, bodies.back().c_str());
  }
  for (int i = 0; i < m->nsensor; ++i) {
    mjsSensor* sensor = mjs_addSensor(spec);
    set_name(sensor->element, m, mjOBJ_SENSOR, i);
    sensor->type = mjSENS_CLOCK;
  }
}

// MuJoCo's hash table of names has this many places for each element.
constexpr int kPlacesPerName = 2;

// MuJoCo's hash function of names.
std::uint64_t hash(const std::string& name) {
  std::uint64_t h = 5381;
  for (const char c : name) h = (h * 33) ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(c));
  return h;
}

// A copy of a model's struct whose arrays may be replaced, and the memory of the new arrays.
class EditedModel {
 public:
  explicit EditedModel(const mjModel* model) : m_(*model) {}
  const mjModel& model() const { return m_; }

  void add_cameras(const mjModel* from, std::span<const int> rows);
  // `cameras`: the id here of each camera of `from`.
  void add_sensors(const mjModel* from, std::span<const int> rows, std::span<const int> cameras);
  // names(type, id): the name of an element.
  template <class NameOf>
  void set_names(NameOf&& name);

 private:
  template <class T>
  T* keep(const std::vector<T>& values) {
    const auto bytes = std::as_bytes(std::span(values));
    memory_.emplace_back(bytes.begin(), bytes.end());
    return reinterpret_cast<T*>(memory_.back().data());
  }
  // The rows of `own`, then those rows of `more`. User data are 0 in the latter.
  template <class T>
  T* append(const T* own, std::int64_t count, std::int64_t width, const T* more, bool user,
            std::span<const int> rows) {
    std::vector<T> all(own, own + count * width);
    for (const int row : rows) {
      for (std::int64_t i = 0; i < width; ++i) all.push_back(user ? T{} : more[row * width + i]);
    }
    return keep(all);
  }

  mjModel m_;
  std::deque<std::vector<std::byte>> memory_;
};

#define X(type, name, nr, nc) \
  m_.name =                   \
      append(m_.name, m_.nr, nc, from->name, std::string_view(#name).ends_with("_user"), rows);

void EditedModel::add_cameras(const mjModel* from, std::span<const int> rows) {
  const mjtSize nuser_cam = m_.nuser_cam;
  MJMODEL_POINTERS_CAMERA
  m_.ncam += static_cast<mjtSize>(rows.size());
}

void EditedModel::add_sensors(const mjModel* from, std::span<const int> rows,
                              std::span<const int> cameras) {
  const mjtSize nuser_sensor = m_.nuser_sensor;
  MJMODEL_POINTERS_SENSOR
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const mjtSize sensor = m_.nsensor++;
    m_.sensor_adr[sensor] = static_cast<int>(m_.nsensordata);
    m_.nsensordata += m_.sensor_dim[sensor];
    if (m_.sensor_objtype[sensor] == mjOBJ_CAMERA)
      m_.sensor_objid[sensor] = cameras[m_.sensor_objid[sensor]];
    if (m_.sensor_reftype[sensor] == mjOBJ_CAMERA)
      m_.sensor_refid[sensor] = cameras[m_.sensor_refid[sensor]];
  }
}

#undef X

// Lists of named elements in the order in which MuJoCo stores their names.
#define NAME_LISTS                               \
  X(nbody, name_bodyadr, mjOBJ_BODY)             \
  X(njnt, name_jntadr, mjOBJ_JOINT)              \
  X(ngeom, name_geomadr, mjOBJ_GEOM)             \
  X(nsite, name_siteadr, mjOBJ_SITE)             \
  X(ncam, name_camadr, mjOBJ_CAMERA)             \
  X(nlight, name_lightadr, mjOBJ_LIGHT)          \
  X(nflex, name_flexadr, mjOBJ_FLEX)             \
  X(nmesh, name_meshadr, mjOBJ_MESH)             \
  X(nskin, name_skinadr, mjOBJ_SKIN)             \
  X(nhfield, name_hfieldadr, mjOBJ_HFIELD)       \
  X(ntex, name_texadr, mjOBJ_TEXTURE)            \
  X(nmat, name_matadr, mjOBJ_MATERIAL)           \
  X(npair, name_pairadr, mjOBJ_PAIR)             \
  X(nexclude, name_excludeadr, mjOBJ_EXCLUDE)    \
  X(neq, name_eqadr, mjOBJ_EQUALITY)             \
  X(ntendon, name_tendonadr, mjOBJ_TENDON)       \
  X(nactuator, name_actuatoradr, mjOBJ_ACTUATOR) \
  X(nsensor, name_sensoradr, mjOBJ_SENSOR)       \
  X(nnumeric, name_numericadr, mjOBJ_NUMERIC)    \
  X(ntext, name_textadr, mjOBJ_TEXT)             \
  X(ntuple, name_tupleadr, mjOBJ_TUPLE)          \
  X(nkey, name_keyadr, mjOBJ_KEY)                \
  X(nplugin, name_pluginadr, mjOBJ_PLUGIN)

template <class NameOf>
void EditedModel::set_names(NameOf&& name) {
  std::string names(m_.names);  // the model's own name
  names += '\0';
  std::vector<int> table;
  const auto list = [&](mjtObj type, mjtSize count) {
    const std::size_t begin = table.size(), places = kPlacesPerName * count;
    table.resize(begin + places, -1);
    std::vector<int> addresses;
    for (int id = 0; id < count; ++id) {
      const std::string text = name(type, id);
      addresses.push_back(static_cast<int>(names.size()));
      names += text;
      names += '\0';
      if (text.empty()) continue;
      std::size_t place = hash(text) % places;
      while (table[begin + place] != -1) place = (place + 1) % places;
      table[begin + place] = id;
    }
    return keep(addresses);
  };
#define X(count, addresses, type) m_.addresses = list(type, m_.count);
  NAME_LISTS
#undef X
  m_.nnames = static_cast<mjtSize>(names.size());
  m_.names = keep(std::vector<char>(names.begin(), names.end()));
  m_.nnames_map = static_cast<mjtSize>(table.size());
  m_.names_map = keep(table);
}

// Size of a model's buffer, in which every array starts at a multiple of 64 bytes, wherever the
// buffer itself starts.
mjtSize buffer_size(const mjModel& m) {
  MJMODEL_POINTERS_PREAMBLE((&m))
  std::uint64_t size = 0;
#define X(type, name, nr, nc) \
  size += (64 - size % 64) % 64 + sizeof(type) * static_cast<std::uint64_t>(m.nr) * (nc);
  MJMODEL_POINTERS
#undef X
  return static_cast<mjtSize>(size + 63);
}

bool contains(std::span<const std::string> names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

}  // namespace

ModelPtr copy_fields(mjModel fields) {
  fields.nbuffer = buffer_size(fields);
  return ModelPtr(call_mujoco(mj_copyModel, nullptr, &fields));
}

CompiledModel::CompiledModel(const mjModel* model, mjSpec* spec) : model_(model), spec_(spec) {
  check_model_indices(*model);
  outline_tree(model, spec);
  name_unnamed(spec);
  outline_rest(model, spec);
  name_unnamed(spec);
  for (const mjtObj type : kOutlined) names_.push_back({type, spec_names(spec, type)});
  for (const mjtObj type : kOthers) names_.push_back({type, {}});
}

void CompiledModel::fail(mjtObj type, const std::string& name) const {
  const std::string xml = save_xml(spec_), attribute = fmt::format("name=\"{}\"", name);
  const std::size_t at = std::min(xml.find(attribute), xml.size());
  const std::size_t begin = xml.rfind('<', at), end = xml.find('>', at);
  const std::string line = at < xml.size() ? xml.substr(begin, end + 1 - begin) : "";
  throw ValueError(
      fmt::format("the model has no {} '{}', which a sensor needs: add {} to the model's XML{}",
                  mju_type2Str(type), name, line.empty() ? "it" : line,
                  type == mjOBJ_SENSOR ? ", in <sensor>" : ""));
}

// Of a spec that was edited, whose compiled model is `outline`.
void CompiledModel::check_additions(const mjModel* outline) const {
  for (const auto& [type, before] : names_) {
    if (type == mjOBJ_CAMERA || type == mjOBJ_SENSOR) continue;
    const std::vector<std::string> now = spec_names(spec_, type);
    for (const std::string& name : now) {
      if (!contains(before, name)) fail(type, name);
    }
    if (now != before)
      throw ValueError(
          fmt::format("a sensor has removed or renamed a {} of the model", mju_type2Str(type)));
  }
  for (mjtSize i = model_->nsensor; i < outline->nsensor; ++i) {
    const int id = static_cast<int>(i);
    // The size of a tactile sensor is that of its mesh, and a history grows with the steps.
    if (outline->sensor_historyadr[id] >= 0 || outline->sensor_type[id] == mjSENS_TACTILE)
      fail(mjOBJ_SENSOR, name_of(outline, mjOBJ_SENSOR, id));
  }
}

ModelPtr CompiledModel::extended(const mjModel* outline) const {
  if (buffer_size(*model_) != model_->nbuffer)
    throw RuntimeError("the model's memory is not laid out as in the MuJoCo of mjsense");
  check_additions(outline);
  // Cameras are numbered by body, and within a body those of the model come first.
  std::vector<int> in_body(model_->nbody), added, ids;
  for (int i = 0; i < model_->ncam; ++i) ++in_body[model_->cam_bodyid[i]];
  int own = 0;
  for (int i = 0; i < outline->ncam; ++i) {
    if (--in_body[outline->cam_bodyid[i]] >= 0) {
      ids.push_back(own++);
      continue;
    }
    if (outline->cam_mode[i] != mjCAMLIGHT_FIXED)
      fail(mjOBJ_CAMERA, name_of(outline, mjOBJ_CAMERA, i));
    ids.push_back(static_cast<int>(model_->ncam + added.size()));
    added.push_back(i);
  }
  std::vector<int> sensors;
  for (mjtSize i = model_->nsensor; i < outline->nsensor; ++i)
    sensors.push_back(static_cast<int>(i));

  EditedModel edited(model_);
  edited.add_cameras(outline, added);
  edited.add_sensors(outline, sensors, ids);
  edited.set_names([&](mjtObj type, int id) {
    if (std::ranges::find(kOutlined, type) == std::end(kOutlined)) return name_of(model_, type, id);
    if (type == mjOBJ_CAMERA) id = static_cast<int>(std::ranges::find(ids, id) - ids.begin());
    return name_of(outline, type, id);
  });
  return copy_fields(edited.model());
}

void CompiledModel::replace_model(Scene& scene) const {
  const ModelPtr model = extended(scene.model());
  std::vector<std::string> warnings;
  check_model(model.get(), warnings);
  // The structs are exchanged with the memory that they own; the outline is deleted.
  std::swap(*model, *const_cast<mjModel*>(scene.model()));
}

}  // namespace mjsense::scene
