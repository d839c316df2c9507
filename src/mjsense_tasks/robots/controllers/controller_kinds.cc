// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

#include <fmt/format.h>

#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_fields.h"

namespace mjsense::tasks::robots {
namespace {

struct Given {
  ControllerCfg controller;
};
template <class V>
void visit_fields(V& v, Given& c) {
  v.object("Given", "A table with a controller.");
  v("controller", c.controller, "The controller.");
}

}  // namespace

ControllerCfg parse_controller(std::string_view text, const std::string& context) {
  Given given;
  const bool table = text.starts_with('{');
  read_toml_fields(
      table ? fmt::format("controller = {}", text) : fmt::format("controller = \"{}\"", text),
      context, given);
  return given.controller;
}

std::unique_ptr<Controller> make_controller(const ControllerCfg& cfg, const MoveGroup& group,
                                            const ControllerInit& init) {
  return std::visit([&](const auto& kind) { return make_kind(kind, group, init); }, cfg);
}

}  // namespace mjsense::tasks::robots
