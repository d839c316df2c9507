// SPDX-License-Identifier: Apache-2.0
#pragma once
// Selects the geoms, bodies or subtrees whose contacts a sensor measures: rules for names, resolved
// to ids.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"

namespace mjsense::sensors {

enum class ContactMode { kGeom, kBody, kSubtree };
constexpr std::array<std::string_view, 3> enum_names(ContactMode) {
  return {"geom", "body", "subtree"};
}

enum class ContactPolicy { kFirst, kError, kAny, kEach };
constexpr std::array<std::string_view, 4> enum_names(ContactPolicy) {
  return {"first", "error", "any", "each"};
}

// With an entity, each pattern is a regular expression (Python's syntax) for the whole local name,
// and the result is in model order. Without one, patterns are full MuJoCo names or regular
// expressions for them, and the result is in the order of the patterns.
struct ContactMatch {
  NamedEnum<ContactMode> mode;
  std::vector<std::string> pattern;
  std::string entity;
  std::vector<std::string> exclude;
};
template <class V>
void visit_fields(V& v, ContactMatch& c) {
  v.object("ContactMatch", "Selects the geoms or bodies that take part in a contact.").frozen();
  v("mode", c.mode, "Type of the matched elements. A subtree is a body and all its descendants.")
      .required();
  v("pattern", c.pattern,
    "With an entity: regular expressions that must match a whole local name. Without: full MuJoCo "
    "names; a pattern that is none and has a special character, such as ``*`` or ``[``, is a "
    "regular expression that must match a whole full name. Each pattern must match something, and "
    "no element may be matched twice.")
      .required()
      .or_one();
  v("entity", c.entity, "Entity that contains the elements.").or_none();
  v("exclude", c.exclude,
    "Names to leave out; an entry with a special character, such as ``*`` or ``[``, is a regular "
    "expression that is searched for.");
}

// Throw ValueError for errors that do not depend on the model. `context` starts the message:
// "sensor 'feet': primary".
void validate(const ContactMatch& match, std::string_view context);
void validate_primary(const ContactMatch& match, std::string_view context);
void validate_secondary(const ContactMatch& match, ContactPolicy policy, std::string_view context);

// One matched geom, body or subtree.
struct ContactObject {
  int id = -1;        // geom id in mode geom, else body id
  std::string name;   // full MuJoCo name
  std::string label;  // local name in its entity; the full name if there is none
};

// Names of a model, or of a spec that is not compiled yet (ids are then indices in the spec).
class ContactNames {
 public:
  explicit ContactNames(const mjModel* model);
  explicit ContactNames(mjSpec* spec);

  // Both functions throw ValueError or KeyError with the sensor, the pattern and the nearest names.
  std::vector<ContactObject> primaries(std::string_view sensor, const ContactMatch& match) const;
  // policy: first, error, or each (several patterns, every match).
  std::vector<ContactObject> secondaries(std::string_view sensor, const ContactMatch& match,
                                         ContactPolicy policy) const;

 private:
  struct Element {
    std::string name;
    int body;    // id of the body, or of the geom's body
    int parent;  // of a body; -1 for a geom
  };
  std::vector<ContactObject> of_entity(std::string_view context, const ContactMatch& match) const;
  std::vector<ContactObject> by_full_name(std::string_view context,
                                          const ContactMatch& match) const;
  std::vector<ContactObject> by_regex(std::string_view context, const ContactMatch& match) const;
  std::vector<ContactObject> matches(std::string_view context, const ContactMatch& match) const;
  const std::vector<Element>& elements(const ContactMatch& match) const;
  bool in_terrain(int body) const;

  std::vector<Element> bodies_, geoms_;
  int terrain_ = -1;  // body "terrain": an entity whose names have no prefix
};

}  // namespace mjsense::sensors
