// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a scene is made of: attached MJCF models, and references to their elements.

#include <mujoco/mujoco.h>

#include <array>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/fields.h"

namespace mjsense {

// Where an MJCF comes from: a path, an XML text, or a file of models/ ("embedded:objects/mug.xml").
struct ModelSource {
  std::string path;                           // read from disk, relative assets beside it
  std::string xml;                            // or this text
  const mjSpec* spec = nullptr;               // or this spec, which is copied
  std::shared_ptr<const mjSpec> owner;        // keeps `spec` alive where nobody else does
  std::map<std::string, std::string> assets;  // name -> bytes, for xml and spec

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
           ":func:`mjsense.embedded_models`), an MjSpec, or a function that makes one.")
      .required();
  v.python("assets", "Mapping[str, bytes]", "field(default_factory=dict)",
           "Files that XML text refers to, by name.");
  v("pos", c.pos,
    "Of the entity's root in the world: of its free body, else of the mocap body that a fixed base "
    "hangs under. A keyframe of the model moves with it: it keeps its pose relative to the root's "
    "pose in the XML.")
      .unit("m");
  v("quat", c.quat, "Of the same, wxyz; the identity keeps what the XML says.");
  v("joint_pos", c.joint_pos,
    "Joint positions (rad, m) of the keyframe ``init_state`` by regular expression that matches "
    "the "
    "whole local name, the first match counts; unless the model has a keyframe.");
  v("mocap_base", c.mocap_base,
    "Hang a model without a free joint under the mocap body ``<entity>/mocap_base``, so that each "
    "world can place it; False: attach it to the world as it is.");
}

// Its rotation and its regular expressions.
void validate(const EntityCfg& cfg, std::string_view place);

// One MuJoCo element. Full name = "entity/name" if entity is non-empty, else "name".
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
           "One MuJoCo element. Its full name is ``entity/name``, or ``name`` without an entity.")
      .frozen();
  v("type", c.type,
    "body (inertial frame), xbody (body frame), joint, geom, site, actuator, tendon, camera, and "
    "so on.");
  v("name", c.name, "Its name in the entity.");
  v("entity", c.entity, "Whose name it is.").or_none();
}

}  // namespace mjsense
