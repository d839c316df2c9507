// SPDX-License-Identifier: Apache-2.0
// records DIRECTORY: records two successful episodes of a Franka that picks up an object, and checks
// the recording.

#include <mjsense_tasks/mjsense_tasks.h>

#include <exception>
#include <iostream>

namespace rollout = mjsense::tasks::rollout;

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "records DIRECTORY\n";
    return 2;
  }
  rollout::RecordJobCfg job;
  job.out = argv[1];
  job.episodes = 2;
  job.rollout.task = "pick";
  job.rollout.robot = "franka";
  job.rollout.policy = "planner";
  job.rollout.num_worlds = 2;
  job.rollout.width = 160;
  job.rollout.height = 120;

  const rollout::RecordSummary made = rollout::record_episodes(job);
  std::cout << made.progress.kept << " episodes, " << made.progress.frames << " images\n";
  for (const auto& [reason, count] : made.failures)
    std::cout << count << " attempts failed: " << reason << "\n";

  const mjsense::replay::VerifyResult checked = mjsense::replay::verify(job.out);
  std::cout << checked.text();
  return made.enough && checked.ok() ? 0 : 1;
} catch (const std::exception& error) {  // names the option, what was found, what was expected
  std::cerr << error.what() << "\n";
  return 1;
}
