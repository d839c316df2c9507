// SPDX-License-Identifier: Apache-2.0
// Checks that the libmujoco loaded by Python is the one this extension was compiled for. The
// extension is not linked to a file name (mjsense/core/libmujoco.py loads the installed library), so it
// compares the layouts of the structs that both use.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/mujoco_call.h"
#include "mjsense/scene/mujoco_log.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

constexpr std::size_t kBeyond = 1024;  // maximum excess over the expected size that is detected
constexpr unsigned char kFirst = 0xA5, kSecond = 0x5A;

// Number of bytes that `set_default` writes to a T, rounded up to its alignment.
template <class T>
std::size_t written(void (*set_default)(T*)) {
  constexpr std::size_t bytes = sizeof(T) + kBeyond;
  constexpr std::size_t words = (bytes + sizeof(std::max_align_t) - 1) / sizeof(std::max_align_t);
  std::vector<std::max_align_t> memory[2] = {std::vector<std::max_align_t>(words),
                                             std::vector<std::max_align_t>(words)};
  const unsigned char* rows[2];
  for (int i = 0; i < 2; ++i) {
    std::memset(memory[i].data(), i == 0 ? kFirst : kSecond, words * sizeof(std::max_align_t));
    set_default(reinterpret_cast<T*>(memory[i].data()));
    rows[i] = reinterpret_cast<const unsigned char*>(memory[i].data());
  }
  std::size_t last = bytes;
  while (last > 0 && rows[0][last - 1] == kFirst && rows[1][last - 1] == kSecond) --last;
  return (last + alignof(T) - 1) / alignof(T) * alignof(T);
}

class Comparison {
 public:
  template <class T>
  void of(const char* name, void (*set_default)(T*)) {
    const std::size_t found = written(set_default);
    if (found != sizeof(T)) {
      add(std::string(name) + " has " + std::to_string(found) + " bytes, expected " +
          std::to_string(sizeof(T)));
    }
  }
  void add(const std::string& text) { text_ += (text_.empty() ? "" : "; ") + text; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

// mjModel and mjData both end with the same signature, which is set at compilation.
bool model_and_data_agree() {
  const std::unique_ptr<mjSpec, decltype(&mj_deleteSpec)> spec(mj_makeSpec(), &mj_deleteSpec);
  const std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model(
      call_mujoco(mj_compile, spec.get(), nullptr), &mj_deleteModel);
  if (!model) return false;
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(
      call_mujoco(mj_makeData, model.get()), &mj_deleteData);
  return data && model->signature != 0 && model->signature == data->signature;
}

// Description of the differences; empty if there are none.
std::string layout_difference() {
  Comparison compare;
  compare.of("mjOption", &mj_defaultOption);
  compare.of("mjVisual", &mj_defaultVisual);
  compare.of("mjSpec", &mjs_defaultSpec);
  compare.of("mjsBody", &mjs_defaultBody);
  compare.of("mjsCamera", &mjs_defaultCamera);
  compare.of("mjsGeom", &mjs_defaultGeom);
  compare.of("mjsHField", &mjs_defaultHField);
  compare.of("mjsJoint", &mjs_defaultJoint);
  compare.of("mjsMesh", &mjs_defaultMesh);
  compare.of("mjsSensor", &mjs_defaultSensor);
  compare.of("mjsSite", &mjs_defaultSite);
  compare.of("mjsTexture", &mjs_defaultTexture);
  compare.of("mjvOption", &mjv_defaultOption);
  compare.of("mjvScene", &mjv_defaultScene);
  compare.of("mjBatchConfig", &mjb_defaultConfig);
  // Only after the sizes are known to agree, because this follows pointers.
  if (compare.text().empty() && !model_and_data_agree())
    compare.add("mjModel or mjData is not as expected");
  return compare.text();
}

}  // namespace

void bind_libmujoco(nb::module_& m) {
  m.attr("mujoco_headers") = mjVERSION_HEADER;
  m.def(
      "mujoco_version", [] { return std::string(mj_versionString()); },
      "Version of the libmujoco that is loaded.");
  m.def("mujoco_layout_difference", &layout_difference,
        "How its structs differ from those this was compiled with; empty: they do not.");
  m.def("leave_no_log_file", &scene::disable_mujoco_log_file,
        "Keeps MUJOCO_LOG.TXT out of the current folder, unless another file was chosen.");
}

}  // namespace mjsense::python
