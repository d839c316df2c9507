// SPDX-License-Identifier: Apache-2.0
#pragma once
// Building blocks of a scene: attached MJCF models, and references to their elements.

#include <mujoco/mujoco.h>

#include <array>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mjsense::scene {

// Source of an MJCF model: a path, an XML text, or a file of models/ ("embedded:objects/mug.xml").
struct ModelSource {
  std::string path;                           // read from disk; assets are relative to it
  std::string xml;                            // or an XML text
  const mjSpec* spec = nullptr;               // or a spec, which is copied
  std::shared_ptr<const mjSpec> owner;        // keeps `spec` alive if it has no other owner
  std::map<std::string, std::string> assets;  // file name -> bytes, for `xml` and `spec`

  bool empty() const { return path.empty() && xml.empty() && spec == nullptr; }
};

struct EntityCfg {
  ModelSource model;
  std::array<double, 3> pos{0, 0, 0};
  std::array<double, 4> quat{1, 0, 0, 0};
  std::vector<std::pair<std::string, double>> joint_pos;
  bool mocap_base = true;
};
template <class V>
void visit_fields(V& v, EntityCfg& c) {
  v.object("EntityCfg",
           "A model that is attached to the scene; all its names get the prefix ``<entity>/``.");
  v.python("model", "str | Path | mujoco.MjSpec | Callable[[], mujoco.MjSpec]", "",
           "Path of an MJCF file, XML text, ``embedded:<file>`` (see "
           ":func:`mjsense.embedded_models`), an MjSpec, or a function that returns one.")
      .required();
  v.python("assets", "Mapping[str, bytes]", "field(default_factory=dict)",
           "Contents of the files that the XML text refers to, by file name.");
  v("pos", c.pos,
    "Position of the entity's root in the world: of its free body or, for a fixed base, of the "
    "mocap body that carries it. A keyframe of the model moves with it: its pose relative to the "
    "root's pose in the XML stays the same.")
      .unit("m");
  v("quat", c.quat,
    "Orientation (wxyz) of the entity's root; the identity keeps the orientation of the XML.");
  v("joint_pos", c.joint_pos,
    "Joint positions (rad, m) of the keyframe ``init_state``, by regular expressions that must "
    "match the whole local joint name; the first match counts. Ignored if the model has a "
    "keyframe.");
  v("mocap_base", c.mocap_base,
    "Attach a model without a free joint to a mocap body ``<entity>/mocap_base``, so that its pose "
    "can differ between worlds. False: attach it to the world body.");
}

// Checks the rotation and the regular expressions.
void validate(const EntityCfg& cfg, std::string_view context);

// A reference to one MuJoCo element. The full name is "entity/name", or "name" if `entity` is
// empty.
struct ObjRef {
  std::string type;
  std::string name;
  std::string entity;
  bool empty() const { return type.empty() && name.empty(); }
  std::string full_name() const { return entity.empty() ? name : entity + "/" + name; }
};
template <class V>
void visit_fields(V& v, ObjRef& c) {
  v.object("ObjRef",
           "A reference to one MuJoCo element. Its full name is ``entity/name``, or ``name`` "
           "without an entity.")
      .frozen();
  v("type", c.type,
    "Type of the element: body (inertial frame), xbody (body frame), joint, geom, site, actuator, "
    "tendon, camera and so on.");
  v("name", c.name, "Name of the element within the entity.");
  v("entity", c.entity, "Entity that contains the element.").or_none();
}

}  // namespace mjsense::scene
