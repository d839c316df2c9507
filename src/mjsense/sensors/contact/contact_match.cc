// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense/core/text/name_matching.h"

namespace mjsense::sensors {
namespace {

std::string_view kind_of(const ContactMatch& match) {
  return match.mode == ContactMode::kGeom ? "geom" : "body";
}

void drop_excluded(std::string_view context, const ContactMatch& match,
                   std::vector<ContactObject>& objects) {
  const std::vector<std::string> before = names_of(objects, &ContactObject::label);
  const Exclude exclude(match.exclude, context);
  std::erase_if(objects, [&](const ContactObject& o) { return exclude.drops(o.label); });
  if (objects.empty()) {
    throw ValueError(
        fmt::format("{}: exclude removes every match: {}", context, fmt::join(before, ", ")));
  }
}

}  // namespace

void validate(const ContactMatch& match, std::string_view context) {
  if (match.pattern.empty()) throw ValueError(fmt::format("{}: no pattern is given", context));
  for (const std::string& pattern : match.pattern) {
    if (pattern.empty()) throw ValueError(fmt::format("{}: a pattern is empty", context));
    // The subtree of a secondary has a literal name, not a pattern.
    if (!match.entity.empty() && match.mode != ContactMode::kSubtree) Regex(pattern, context);
  }
  Exclude(match.exclude, context);
}

void validate_primary(const ContactMatch& match, std::string_view context) {
  validate(match, context);
  for (const std::string& pattern : match.pattern) {
    if (!match.entity.empty()) Regex(pattern, context);
  }
}

void validate_secondary(const ContactMatch& match, ContactPolicy policy, std::string_view context) {
  validate(match, context);
  if (policy != ContactPolicy::kEach && policy != ContactPolicy::kAny &&
      match.pattern.size() != 1) {
    throw ValueError(
        fmt::format("{}: {} patterns: must be a single name (policy 'each' takes several)", context,
                    match.pattern.size()));
  }
}

ContactNames::ContactNames(const mjModel* m) {
  for (int b = 0; b < m->nbody; ++b) {
    bodies_.push_back({m->names + m->name_bodyadr[b], b, m->body_parentid[b]});
    if (bodies_.back().name == "terrain") terrain_ = b;
  }
  for (int g = 0; g < m->ngeom; ++g) {
    geoms_.push_back({m->names + m->name_geomadr[g], m->geom_bodyid[g], -1});
  }
}

ContactNames::ContactNames(mjSpec* spec) {
  std::unordered_map<const mjsElement*, int> index;
  for (mjsElement* e = mjs_firstElement(spec, mjOBJ_BODY); e; e = mjs_nextElement(spec, e)) {
    const int b = static_cast<int>(bodies_.size());
    index[e] = b;
    const mjsBody* parent = b > 0 ? mjs_getParent(e) : nullptr;
    const auto p = parent ? index.find(parent->element) : index.end();
    bodies_.push_back({mjs_getString(mjs_getName(e)), b, p == index.end() ? 0 : p->second});
    if (bodies_.back().name == "terrain") terrain_ = b;
  }
  for (mjsElement* e = mjs_firstElement(spec, mjOBJ_GEOM); e; e = mjs_nextElement(spec, e)) {
    const mjsBody* parent = mjs_getParent(e);
    const auto p = parent ? index.find(parent->element) : index.end();
    geoms_.push_back({mjs_getString(mjs_getName(e)), p == index.end() ? 0 : p->second, -1});
  }
}

const std::vector<ContactNames::Element>& ContactNames::elements(const ContactMatch& match) const {
  return match.mode == ContactMode::kGeom ? geoms_ : bodies_;
}

bool ContactNames::in_terrain(int body) const {
  while (body > 0 && body != terrain_) body = bodies_[body].parent;
  return body > 0;
}

// All named elements of the entity, in model order.
std::vector<ContactObject> ContactNames::of_entity(std::string_view context,
                                                   const ContactMatch& match) const {
  const std::string prefix = match.entity + "/";
  const bool terrain = match.entity == "terrain" && terrain_ > 0;
  std::vector<ContactObject> result;
  const std::vector<Element>& all = elements(match);
  for (int id = 0; id < static_cast<int>(all.size()); ++id) {
    const std::string& name = all[id].name;
    if (name.empty()) continue;
    if (name.starts_with(prefix)) {
      result.push_back({id, name, name.substr(prefix.size())});
    } else if (terrain && in_terrain(all[id].body)) {
      result.push_back({id, name, name});
    }
  }
  if (!result.empty()) return result;

  std::vector<std::string> entities;
  for (const Element& b : bodies_) {
    const std::size_t slash = b.name.find('/');
    const std::string entity = b.name == "terrain" ? b.name : b.name.substr(0, slash);
    if (slash == std::string::npos && b.name != "terrain") continue;
    if (std::find(entities.begin(), entities.end(), entity) == entities.end()) {
      entities.push_back(entity);
    }
  }
  if (std::find(entities.begin(), entities.end(), match.entity) == entities.end()) {
    throw ValueError(fmt::format(
        "{}: entity '{}' not found{}", context, match.entity,
        entities.empty()
            ? "; the model has no entities: leave out entity, and give the names of the "
              "model as they are"
            : suggest(match.entity, entities)));
  }
  throw ValueError(
      fmt::format("{}: entity '{}' has no named {}", context, match.entity, kind_of(match)));
}

// A full name selects that element. Other patterns with a special character are regular expressions.
std::vector<ContactObject> ContactNames::by_full_name(std::string_view context,
                                                      const ContactMatch& match) const {
  std::vector<ContactObject> named;
  const std::vector<Element>& all = elements(match);
  for (int id = 0; id < static_cast<int>(all.size()); ++id) {
    if (!all[id].name.empty()) named.push_back({id, all[id].name, all[id].name});
  }
  const std::vector<std::string> names = names_of(named, &ContactObject::label);
  std::vector<ContactObject> result;
  for (const std::string& pattern : match.pattern) {
    std::vector<int> matches;
    const auto found = std::find(names.begin(), names.end(), pattern);
    if (found != names.end())
      matches.push_back(static_cast<int>(found - names.begin()));
    else if (is_regex(pattern))
      matches = match_names(std::span(&pattern, 1), names, context);
    else
      throw_unknown(context, kind_of(match), pattern, names);
    for (int i : matches) {
      for (const ContactObject& other : result) {
        if (other.id == named[i].id)
          throw ValueError(fmt::format("{}: '{}' is given twice", context, names[i]));
      }
      result.push_back(named[i]);
    }
  }
  return result;
}

std::vector<ContactObject> ContactNames::by_regex(std::string_view context,
                                                  const ContactMatch& match) const {
  const std::vector<ContactObject> all = of_entity(context, match);
  std::vector<ContactObject> result;
  for (int i : match_names(match.pattern, names_of(all, &ContactObject::label), context))
    result.push_back(all[i]);
  return result;
}

std::vector<ContactObject> ContactNames::matches(std::string_view context,
                                                 const ContactMatch& match) const {
  std::vector<ContactObject> result =
      match.entity.empty() ? by_full_name(context, match) : by_regex(context, match);
  drop_excluded(context, match, result);
  return result;
}

std::vector<ContactObject> ContactNames::primaries(std::string_view sensor,
                                                   const ContactMatch& match) const {
  const std::string context = fmt::format("sensor '{}': primary", sensor);
  validate_primary(match, context);
  return matches(context, match);
}

std::vector<ContactObject> ContactNames::secondaries(std::string_view sensor,
                                                     const ContactMatch& match,
                                                     ContactPolicy policy) const {
  const std::string context = fmt::format("sensor '{}': secondary", sensor);
  validate_secondary(match, policy, context);
  if (policy == ContactPolicy::kEach) return matches(context, match);
  if (!match.entity.empty() &&
      match.mode == ContactMode::kSubtree) {  // a literal name, as in mjlab
    const std::vector<ContactObject> all = of_entity(context, match);
    std::vector<ContactObject> result;
    for (const ContactObject& o : all) {
      if (o.label == match.pattern[0]) result = {o};
    }
    if (result.empty())
      throw_unknown(context, "body", match.pattern[0], names_of(all, &ContactObject::label));
    drop_excluded(context, match, result);
    return result;
  }
  std::vector<ContactObject> result = matches(context, match);
  if (result.size() > 1 && policy == ContactPolicy::kError) {
    throw ValueError(fmt::format("{}: '{}' matches {} names: {}", context, match.pattern[0],
                                 result.size(),
                                 fmt::join(names_of(result, &ContactObject::label), ", ")));
  }
  result.resize(1);
  return result;
}

}  // namespace mjsense::sensors
