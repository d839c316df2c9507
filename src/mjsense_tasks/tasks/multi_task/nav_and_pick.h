// SPDX-License-Identifier: Apache-2.0
#pragma once
// Driving to an object and picking it up: nav_to_obj and pick with the same object. The task
// succeeds if pick does; its reward is the sum of both rewards.

#include "mjsense_tasks/tasks/multi_task/multi_task.h"

namespace mjsense::tasks {

class NavAndPickTask final : public MultiTask {
 public:
  explicit NavAndPickTask(const episode::TaskCfg& cfg);
  std::string_view type() const override { return "nav_and_pick"; }
  std::string description(int world) const override;  // "Navigate to the mug and pick it up"

 protected:
  void choose_goals(int world, const robots::StateRow& state) override;
  episode::Evaluation combined(int world, std::span<const episode::Evaluation> of_children,
                               std::size_t stride) const override;
  std::string paraphrase(const World& world, Rng& rng) const override;
};

}  // namespace mjsense::tasks
