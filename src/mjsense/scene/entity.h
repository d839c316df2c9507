#pragma once
// What a scene is made of: attached MJCF models, and references to their elements.

#include <array>
#include <map>
#include <string>
#include <vector>

namespace mjsense {

// Where an MJCF comes from: a path, an XML text, or a file of models/ ("embedded:franka/fr3.xml").
struct ModelSource {
  std::string path;                           // read from disk, relative assets beside it
  std::string xml;                            // or this text
  std::map<std::string, std::string> assets;  // name -> bytes, for xml
};

struct EntityCfg {
  ModelSource model;
  std::array<double, 3> pos{0, 0, 0};      // m, of the entity's root in the world
  std::array<double, 4> quat{1, 0, 0, 0};  // wxyz
};

// One MuJoCo element. Full name = "entity/name" if entity is non-empty, else "name".
struct ObjRef {
  std::string type;    // body xbody joint geom site actuator tendon camera ...
  std::string name;
  std::string entity;
  bool empty() const { return type.empty() && name.empty(); }
  std::string full_name() const { return entity.empty() ? name : entity + "/" + name; }
};

}  // namespace mjsense
