#include "mjsense/policies/policy.h"

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/pick_planner.h"

namespace mjsense {
namespace {

struct Entry {
  const char* name;
  std::unique_ptr<Policy> (*make)();
};

constexpr Entry kPolicies[] = {
    {"planner", []() -> std::unique_ptr<Policy> { return std::make_unique<PickPlanner>(); }},
};

}  // namespace

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kPolicies) names.emplace_back(entry.name);
  return names;
}

std::unique_ptr<Policy> make_policy(std::string_view name) {
  for (const Entry& entry : kPolicies) {
    if (name == entry.name) return entry.make();
  }
  throw_unknown("policies", "policy", name, policy_names());
}

}  // namespace mjsense
