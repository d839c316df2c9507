// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_assets.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"

// Null with MuJoCo 4.0.0, which lacks this function.
extern "C" __attribute__((weak)) const char* mjs_getInStringVec(const mjStringVec* source, int i);

namespace mjsense::scene {
namespace {

namespace fs = std::filesystem;

class AssetResolver {
 public:
  AssetResolver(const ModelSource& source, const std::string& entity, Vfs& vfs)
      : source_(source), entity_(entity), vfs_(vfs) {}

  // Returns the new name of `file`, which the element specifies relative to `dir`.
  std::string operator()(const mjsElement* element, const char* dir, std::string file) const {
    const mjSpec* origin = mjs_getOriginSpec(element);
    if (origin->strippath) file = fs::path(file).filename().string();
    const std::string joined = (fs::path(dir) / file).lexically_normal().generic_string();
    for (const std::string& name : {joined, file, fs::path(file).filename().string()}) {
      if (auto it = source_.assets.find(name); it != source_.assets.end())
        return in_memory(it->first, it->second);
    }
    const fs::path base = mjs_getString(origin->modelfiledir);
    std::string path = (base / joined).lexically_normal().generic_string();
    if (!base.empty()) path = fs::absolute(path).generic_string();
    // "provider:name" refers to MuJoCo's resource providers.
    if (path.find(':') == std::string::npos && !fs::exists(path)) missing(element, path);
    return path;
  }

 private:
  [[noreturn]] void missing(const mjsElement* element, const std::string& path) const {
    std::vector<std::string> names;
    for (const auto& [name, bytes] : source_.assets) names.push_back(name);
    throw ValueError(fmt::format(
        "{}: {} '{}': no file '{}'{}", entity_.empty() ? "scene base" : "entity '" + entity_ + "'",
        obj_type_name(element->elemtype), element_name(element), path, suggest(path, names)));
  }

  std::string in_memory(const std::string& name, const std::string& bytes) const {
    const auto taken = vfs_.files().find(name);
    const bool clash = taken != vfs_.files().end() && taken->second != bytes;
    const std::string unique = clash ? entity_ + "/" + name : name;
    vfs_.add(unique, bytes, fmt::format("entity '{}'", entity_));
    return unique;
  }

  const ModelSource& source_;
  const std::string& entity_;
  Vfs& vfs_;
};

// Returns name `i` of a list; null beyond its end.
const char* name_in(const mjStringVec* names, int i) {
  if (mjs_getInStringVec) return mjs_getInStringVec(names, i);
  // Fallback for MuJoCo 4.0.0: the list is a std::vector of its own standard library's strings;
  // mjs_getString() reads one of them.
  constexpr std::ptrdiff_t kString = 24;
  struct {
    const char *begin, *end;
  } list;
  std::memcpy(&list, names, sizeof list);
  if (!list.begin || i >= (list.end - list.begin) / kString) return nullptr;
  return mjs_getString(reinterpret_cast<const mjString*>(list.begin + i * kString));
}

}  // namespace

void adopt_assets(mjSpec* child, const ModelSource& source, const std::string& entity, Vfs& vfs) {
  const AssetResolver adopt(source, entity, vfs);
  const auto rename = [&](mjsElement* element, mjString* file, bool texture) {
    const std::string old = mjs_getString(file);
    if (old.empty()) return;
    const mjsCompiler* compiler = mjs_getCompiler(element);
    mjs_setString(
        file, adopt(element, mjs_getString(texture ? compiler->texturedir : compiler->meshdir), old)
                  .c_str());
  };
  for (mjsElement* e : spec_elements(child, mjOBJ_MESH)) rename(e, mjs_asMesh(e)->file, false);
  for (mjsElement* e : spec_elements(child, mjOBJ_HFIELD)) rename(e, mjs_asHField(e)->file, false);
  for (mjsElement* e : spec_elements(child, mjOBJ_SKIN)) rename(e, mjs_asSkin(e)->file, false);
  for (mjsElement* e : spec_elements(child, mjOBJ_TEXTURE)) {
    mjsTexture* texture = mjs_asTexture(e);
    rename(e, texture->file, true);
    const char* dir = mjs_getString(mjs_getCompiler(e)->texturedir);
    for (int i = 0; i < 6; ++i) {
      const char* file = name_in(texture->cubefiles, i);
      if (!file || !*file) continue;
      mjs_setInStringVec(texture->cubefiles, i, adopt(e, dir, file).c_str());
    }
  }
  // The names now include the directories.
  mjs_setString(child->compiler.meshdir, "");
  mjs_setString(child->compiler.texturedir, "");
  child->strippath = 0;
}

}  // namespace mjsense::scene
