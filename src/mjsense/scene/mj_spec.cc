// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/mj_spec.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/files/embedded_files.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/named.h"
#include "mjsense/scene/resolve.h"

// Exported for MuJoCo's own Python bindings: number of significant digits in saved XML.
extern "C" int _mjPRIVATE__get_xml_precision(void);
extern "C" void _mjPRIVATE__set_xml_precision(int precision);

namespace mjsense::scene {
namespace {

constexpr std::string_view kEmbedded = "embedded:";

SpecPtr checked(mjSpec* spec, const char* error, std::string_view context) {
  if (!spec) throw ValueError(fmt::format("{}: {}", context, one_line(error)));
  return SpecPtr(spec);
}

// A model that attaches another one without a prefix may have two default classes of the same name.
// MuJoCo writes such XML but cannot read it. Elements are written relative to the last of these
// classes, so the others are renamed to unused names.
void make_defaults_unique(std::string& xml) {
  constexpr std::string_view kTag = "<default class=\"";
  std::set<std::string> taken;
  std::vector<std::pair<std::size_t, std::string>> classes;  // positions of the names, last first
  for (std::size_t at = xml.find(kTag); at != std::string::npos; at = xml.find(kTag, at)) {
    at += kTag.size();
    classes.insert(classes.begin(), {at, xml.substr(at, xml.find('"', at) - at)});
    taken.insert(classes.front().second);
  }
  std::set<std::string> seen;
  for (const auto& [at, name] : classes) {
    if (seen.insert(name).second) continue;
    std::string other = name + "_";
    while (!taken.insert(other).second) other += "_";
    xml.replace(at, name.size(), other);
  }
}

std::optional<std::string> try_save(const mjSpec* spec, std::string& why) {
  char error[1024] = "";
  std::string xml(1 << 16, '\0');
  int needed = call_mujoco(mj_saveXMLString, spec, xml.data(), static_cast<int>(xml.size()), error,
                           sizeof error);
  if (needed > 0) {
    xml.resize(needed + 1);
    needed = call_mujoco(mj_saveXMLString, spec, xml.data(), static_cast<int>(xml.size()), error,
                         sizeof error);
  }
  why = error;
  if (needed != 0) return std::nullopt;
  xml.resize(xml.find('\0'));
  make_defaults_unique(xml);
  return xml;
}

}  // namespace

void Vfs::add(const std::string& name, std::string_view bytes, std::string_view context) {
  if (auto it = files_.find(name); it != files_.end()) {
    if (it->second == bytes) return;
    throw ValueError(
        fmt::format("{}: asset '{}' differs from another entity's asset of that name; rename one",
                    context, name));
  }
  const auto it = files_.emplace(name, std::string(bytes)).first;
  const int failed =
      mj_addBufferVFS(&vfs_, name.c_str(), it->second.data(), static_cast<int>(it->second.size()));
  if (failed)
    throw ValueError(fmt::format("{}: MuJoCo did not accept the asset '{}' ({} bytes)", context,
                                 name, bytes.size()));
}

SpecPtr parse_model(const ModelSource& source, std::string_view context) {
  Vfs vfs;
  char error[1024] = "";
  for (const auto& [name, bytes] : source.assets) vfs.add(name, bytes, context);
  if (source.spec) {
    if (!source.path.empty() || !source.xml.empty())
      throw ValueError(fmt::format("{}: give only one of a spec, a path and an XML text", context));
    return checked(call_mujoco(mj_copySpec, source.spec), "MuJoCo cannot copy its spec", context);
  }
  if (!source.xml.empty()) {
    if (!source.path.empty())
      throw ValueError(fmt::format("{}: give a path or an XML text, not both", context));
    return checked(
        call_mujoco(mj_parseXMLString, source.xml.c_str(), vfs.get(), error, sizeof error), error,
        context);
  }
  if (source.path.empty())
    throw ValueError(fmt::format("{}: no model; give a path or an XML text", context));
  if (source.path.starts_with(kEmbedded)) {
    const std::string name = source.path.substr(kEmbedded.size());
    // Embedded models name no other files.
    vfs.add(name, embedded_file(name), context);
    return checked(call_mujoco(mj_parseXML, name.c_str(), vfs.get(), error, sizeof error), error,
                   context);
  }
  if (!std::filesystem::is_regular_file(source.path)) {
    throw ValueError(fmt::format("{}: no file '{}'", context, source.path));
  }
  // An absolute path, so that its assets are found from any folder.
  const std::string path = std::filesystem::absolute(source.path).lexically_normal().string();
  return checked(call_mujoco(mj_parse, path.c_str(), nullptr, vfs.get(), error, sizeof error),
                 error, fmt::format("{} ({})", context, source.path));
}

std::string explain_fault(const ModelSource& source, std::string_view context) {
  Vfs vfs;
  for (const auto& [name, bytes] : source.assets) vfs.add(name, bytes, context);
  const SpecPtr spec = parse_model(source, context);
  const ModelPtr model(call_mujoco(mj_compile, spec.get(), vfs.get()));
  return model ? "" : one_line(mjs_getError(spec.get()));
}

std::string one_line(std::string_view message) {
  std::string out;
  for (std::string_view prefix : {"XML Error: ", "Error: ", "Error: "}) {
    if (message.starts_with(prefix)) message.remove_prefix(prefix.size());
  }
  for (char c : message) {
    if (c == '\n') {
      if (!out.empty() && !out.ends_with("; ")) out += "; ";
    } else {
      out += c;
    }
  }
  while (out.ends_with("; ")) out.resize(out.size() - 2);
  return out;
}

ModelPtr compile(mjSpec* spec, const Vfs& vfs) {
  const mjtBool save = spec->compiler.saveinertial;
  spec->compiler.saveinertial = 1;  // save_compiled_xml() depends on the value at compilation
  ModelPtr model(call_mujoco(mj_compile, spec, vfs.get()));
  spec->compiler.saveinertial = save;
  return model;
}

std::string save_xml(mjSpec* spec) {
  std::string error;
  spec->compiler.savecompiled = 0;
  if (auto xml = try_save(spec, error)) return *std::move(xml);
  return save_compiled_xml(spec, "scene");
}

std::string save_compiled_xml(mjSpec* spec, std::string_view context) {
  std::string error;
  spec->compiler.savecompiled = 1;
  const int digits = _mjPRIVATE__get_xml_precision();
  _mjPRIVATE__set_xml_precision(17);
  auto xml = try_save(spec, error);
  _mjPRIVATE__set_xml_precision(digits);
  spec->compiler.savecompiled = 0;
  if (!xml) throw RuntimeError(fmt::format("{}: not saved as XML: {}", context, one_line(error)));
  return *std::move(xml);
}

std::string element_name(const mjsElement* element) {
  return mjs_getString(mjs_getName(const_cast<mjsElement*>(element)));
}

std::vector<mjsElement*> spec_elements(const mjSpec* spec, mjtObj type) {
  std::vector<mjsElement*> elements;
  for (mjsElement* e = mjs_firstElement(spec, type); e; e = mjs_nextElement(spec, e))
    elements.push_back(e);
  return elements;
}

std::vector<std::string> spec_names(const mjSpec* spec, mjtObj type) {
  return names_of(spec_elements(spec, type), element_name);
}

mjsElement* find_in_spec(const mjSpec* spec, mjtObj type, const std::string& name,
                         std::string_view context) {
  if (type == mjOBJ_XBODY) type = mjOBJ_BODY;
  if (type == mjOBJ_BODY && name == "world") return mjs_findBody(spec, "world")->element;
  mjsElement* element = name.empty() ? nullptr : mjs_findElement(spec, type, name.c_str());
  if (!element) throw_unknown(context, obj_type_name(type), name, spec_names(spec, type));
  return element;
}

}  // namespace mjsense::scene
