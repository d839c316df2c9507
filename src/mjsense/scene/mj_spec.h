// SPDX-License-Identifier: Apache-2.0
#pragma once
// C++ helpers for MuJoCo's mjSpec: ownership, names, and messages as exceptions and strings. The
// wheel's libmujoco is built with a different C++ standard library, so mjString, mjDoubleVec etc.
// must be accessed through the mjs_get* and mjs_set* functions only.

#include <mujoco/mujoco.h>

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/entity.h"

namespace mjsense::scene {

struct SpecDelete {
  bool owned = true;
  void operator()(mjSpec* spec) const {
    if (owned) mj_deleteSpec(spec);
  }
};
using SpecPtr = std::unique_ptr<mjSpec, SpecDelete>;

// Files in memory for parsing and compiling.
class Vfs {
 public:
  Vfs() { mj_defaultVFS(&vfs_); }
  ~Vfs() { mj_deleteVFS(&vfs_); }
  Vfs(const Vfs&) = delete;
  Vfs& operator=(const Vfs&) = delete;

  // Files with the same name must have the same content, otherwise throws ValueError; `context`
  // identifies the user of the file.
  void add(const std::string& name, std::string_view bytes, std::string_view context);
  const mjVFS* get() const { return &vfs_; }
  const std::map<std::string, std::string>& files() const { return files_; }

 private:
  mjVFS vfs_;
  std::map<std::string, std::string> files_;
};

// Parses a model. Throws ValueError with MuJoCo's message; `context` names the entity.
SpecPtr parse_model(const ModelSource& source, std::string_view context);

// MuJoCo's error message when the model is compiled on its own; "" if it compiles.
std::string explain_fault(const ModelSource& source, std::string_view context);

// MuJoCo's message without line breaks and without its "Error:".
std::string one_line(std::string_view message);

// Returns null on failure, with the reason in mjs_getError().
ModelPtr compile(mjSpec* spec, const Vfs& vfs);

// Writes the compiled spec as MJCF: exactly as written, if one file can express that; otherwise
// (entities that were compiled with different settings) with the values computed by compilation.
std::string save_xml(mjSpec* spec);

// Writes the values computed by compile(), with all digits and with the effects of the <compiler>
// settings. Throws RuntimeError that starts with `context`.
std::string save_compiled_xml(mjSpec* spec, std::string_view context);

std::string element_name(const mjsElement* element);
// Elements of one type, in the order of the spec.
std::vector<mjsElement*> spec_elements(const mjSpec* spec, mjtObj type);
std::vector<std::string> spec_names(const mjSpec* spec, mjtObj type);

// Finds an element by its full name. Throws KeyError with the nearest names. XBODY is looked up as
// BODY.
mjsElement* find_in_spec(const mjSpec* spec, mjtObj type, const std::string& name,
                         std::string_view context);

}  // namespace mjsense::scene
