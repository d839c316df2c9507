// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/multi_task/nav_and_pick.h"

#include <array>

#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks {
namespace {

constexpr double kWithinReach = 0.85;  // m, of the base from an object that is picked up
constexpr std::array<const char*, 6> kThenPick{" and pick it up",   ", then pick it up",
                                               " and lift it",      " and grab it",
                                               ", then lift it up", " and take it"};

std::vector<std::unique_ptr<episode::Task>> nav_and_pick(const episode::TaskCfg& cfg) {
  auto drive = std::make_unique<NavToObjTask>(cfg);
  drive->require_graspable_within(kWithinReach);
  std::vector<std::unique_ptr<episode::Task>> both;
  both.push_back(std::move(drive));
  both.push_back(std::make_unique<PickTask>(cfg));
  return both;
}

// "Can you go to the mug?" and " and lift it" are "Can you go to the mug and lift it?".
std::string then(std::string sentence, std::string_view more) {
  sentence.insert(sentence.size() - (sentence.ends_with('?') ? 1 : 0), more);
  return sentence;
}

}  // namespace

NavAndPickTask::NavAndPickTask(const episode::TaskCfg& cfg)
    : MultiTask("nav_and_pick", cfg, nav_and_pick(cfg)) {}

void NavAndPickTask::choose_goals(int world, const robots::StateRow& state) {
  static_cast<PickTask&>(child(1)).choose_object(world, child(0).objects(world)[0].body, state);
}

episode::Evaluation NavAndPickTask::combined(int world,
                                             std::span<const episode::Evaluation> of_children,
                                             std::size_t stride) const {
  const episode::Evaluation &drive = of_children[0], &pick = of_children[stride];
  episode::Evaluation both = make_evaluation(world, drive.reward + pick.reward, pick.success,
                                             drive.terminal || pick.terminal);
  both.missing = pick.missing;
  return both;
}

std::string NavAndPickTask::description(int world) const {
  return then(child(0).description(world), kThenPick[0]);
}

std::string NavAndPickTask::paraphrase(const World& world, Rng& rng) const {
  const std::string drive = paraphrase_of(0, world, rng);
  return drive.empty() ? "" : then(drive, kThenPick[rng.below(kThenPick.size())]);
}

}  // namespace mjsense::tasks
