#pragma once
// What a scene is made of: attached MJCF models, and references to their elements.

#include <mujoco/mujoco.h>

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mjsense {

// Where an MJCF comes from: a path, an XML text, or a file of models/ ("embedded:franka/fr3.xml").
struct ModelSource {
  std::string path;                           // read from disk, relative assets beside it
  std::string xml;                            // or this text
  const mjSpec* spec = nullptr;               // or this spec, which is copied
  std::map<std::string, std::string> assets;  // name -> bytes, for xml and spec

  bool empty() const { return path.empty() && xml.empty() && spec == nullptr; }
};

struct EntityCfg {
  ModelSource model;
  // Pose of the entity's root in the world: of its free body, else of the mocap body that a fixed
  // base hangs under. The identity keeps what the XML says.
  std::array<double, 3> pos{0, 0, 0};      // m
  std::array<double, 4> quat{1, 0, 0, 0};  // wxyz
  // Values of hinges and slides in the keyframe init_state, used when the XML has no keyframe of
  // its own: (regular expression that matches the whole local name, rad or m), the first match
  // counts, 0 without one.
  std::vector<std::pair<std::string, double>> joint_pos;
  // An entity without a free joint is hung under the mocap body "<name>/mocap_base", so that each
  // world can place it. False attaches it to the world as it is (static scenery).
  bool mocap_base = true;
};

// Throws ValueError for what is wrong whatever the model is.
void validate(const EntityCfg& cfg, std::string_view place);

// One MuJoCo element. Full name = "entity/name" if entity is non-empty, else "name".
struct ObjRef {
  std::string
      type;  // body (inertial frame) xbody (body frame) joint geom site actuator tendon camera ...
  std::string name;
  std::string entity;
  bool empty() const { return type.empty() && name.empty(); }
  std::string full_name() const { return entity.empty() ? name : entity + "/" + name; }
};

}  // namespace mjsense
