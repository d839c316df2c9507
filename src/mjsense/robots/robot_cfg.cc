#include "mjsense/robots/robot_cfg.h"

#include "mjsense/core/error.h"
#include "mjsense/robots/franka/franka.h"

namespace mjsense {
namespace {

struct Entry {
  const char* name;
  RobotCfg (*make)();
};

constexpr Entry kRobots[] = {
    {"franka", franka_cfg},
};

}  // namespace

std::vector<std::string> robot_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kRobots) names.emplace_back(entry.name);
  return names;
}

RobotCfg robot_cfg(std::string_view name) {
  for (const Entry& entry : kRobots) {
    if (name == entry.name) return entry.make();
  }
  throw_unknown("robots", "robot", name, robot_names());
}

}  // namespace mjsense
