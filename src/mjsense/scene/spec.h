// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's mjSpec in C++: owners, names, and its messages as exceptions and strings. libmujoco of
// the wheel is built with another C++ library than ours: touch mjString, mjDoubleVec ... only
// through the mjs_get* and mjs_set* functions.

#include <mujoco/mujoco.h>

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/scene/entity.h"

namespace mjsense {

struct SpecDelete {
  bool owned = true;
  void operator()(mjSpec* spec) const {
    if (owned) mj_deleteSpec(spec);
  }
};
struct ModelDelete {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
using SpecPtr = std::unique_ptr<mjSpec, SpecDelete>;
using ModelPtr = std::unique_ptr<mjModel, ModelDelete>;

// Files in memory for parsing and compiling.
class Vfs {
 public:
  Vfs() { mj_defaultVFS(&vfs_); }
  ~Vfs() { mj_deleteVFS(&vfs_); }
  Vfs(const Vfs&) = delete;
  Vfs& operator=(const Vfs&) = delete;

  // A second file of one name must be the same file, else ValueError: `place` says who wanted it.
  void add(const std::string& name, std::string_view bytes, std::string_view place);
  const mjVFS* get() const { return &vfs_; }
  const std::map<std::string, std::string>& files() const { return files_; }

 private:
  mjVFS vfs_;
  std::map<std::string, std::string> files_;
};

// Parses a model. Throws ValueError with MuJoCo's text; `place` names the entity.
SpecPtr parse_model(const ModelSource& source, std::string_view place);

// What MuJoCo says when it compiles the model by itself; "" if it does compile.
std::string explain_fault(const ModelSource& source, std::string_view place);

// MuJoCo's message without its line breaks and its "Error:".
std::string one_line(std::string_view message);

// Null if it fails: mjs_getError() says why.
ModelPtr compile(mjSpec* spec, const Vfs& vfs);

// The compiled spec as MJCF: as it is written where one file can say it, exactly; else, where
// entities were compiled with settings of their own, the values that compilation made.
std::string save_xml(mjSpec* spec);

// The values that compile() made, with all their digits: what settings of <compiler> have done to
// them too. Throws RuntimeError that starts with `place`.
std::string save_compiled_xml(mjSpec* spec, std::string_view place);

std::string element_name(const mjsElement* element);
// The elements of one type, in the order of the spec.
std::vector<mjsElement*> spec_elements(const mjSpec* spec, mjtObj type);
std::vector<std::string> spec_names(const mjSpec* spec, mjtObj type);

// Element of the spec by its full name; throws KeyError with the nearest names. XBODY is looked up
// as BODY.
mjsElement* find_in_spec(const mjSpec* spec, mjtObj type, const std::string& name,
                         std::string_view place);

}  // namespace mjsense
