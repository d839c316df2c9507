#pragma once
// Which geoms, bodies or subtrees a contact sensor watches: rules over names, resolved to ids.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

// With an entity, each pattern is a regular expression (Python's meaning) for the whole local name;
// the result is in model order. Without one, patterns are full MuJoCo names, in the given order.
struct ContactMatch {
  std::string mode = "geom";         // geom, body, or subtree: a body and everything below it
  std::vector<std::string> pattern;  // each must match something, and no name two of them
  std::string entity;                // "" for full names
  // With an entity: names left out. An entry with a regex character is searched anywhere in the
  // name, another must equal it.
  std::vector<std::string> exclude;
};

// Throw ValueError for what is wrong in any model. `place` starts the message: "sensor 'feet': primary".
void validate(const ContactMatch& match, std::string_view place);
void validate_primary(const ContactMatch& match, std::string_view place);
void validate_secondary(const ContactMatch& match, std::string_view policy, std::string_view place);

// One matched geom, body or subtree.
struct ContactObject {
  int id = -1;        // geom id in mode geom, else body id
  std::string name;   // full MuJoCo name
  std::string label;  // local name in its entity; the full name without one
};

// Names of a model, or of a spec that is not compiled yet (ids are then positions in the spec).
class ContactNames {
 public:
  explicit ContactNames(const mjModel* model);
  explicit ContactNames(mjSpec* spec);

  // Both throw ValueError or KeyError that names the sensor, the pattern and the nearest names.
  std::vector<ContactObject> primaries(std::string_view sensor, const ContactMatch& match) const;
  // policy: first, error, or each (several patterns, every match).
  std::vector<ContactObject> secondaries(std::string_view sensor, const ContactMatch& match,
                                         std::string_view policy) const;

 private:
  struct Element {
    std::string name;
    int body;    // body id: itself, or the geom's
    int parent;  // of a body
  };
  std::vector<ContactObject> of_entity(std::string_view place, const ContactMatch& match) const;
  std::vector<ContactObject> literal(std::string_view place, const ContactMatch& match) const;
  std::vector<ContactObject> by_regex(std::string_view place, const ContactMatch& match) const;
  const std::vector<Element>& elements(const ContactMatch& match) const;
  bool in_terrain(int body) const;

  std::vector<Element> bodies_, geoms_;
  int terrain_ = -1;  // body "terrain": an entity whose names have no prefix
};

}  // namespace mjsense
