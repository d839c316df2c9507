// SPDX-License-Identifier: Apache-2.0
#pragma once
// What the data of a recording depend on, as JSON text: every field that declares it, what fields
// become that leave it to the robot or the task, and checksums of the robot's and the scene's files
// and of the user's code. A recording is resumed only with equal settings. The number of worlds and
// threads is not among them.

#include <string>

#include "mjsense/rollout/record_job.h"

namespace mjsense {

// Throws ValueError where `job` resumes with a task, policy or scene of the caller's that does not
// say what it depends on (RolloutCfg::code).
[[nodiscard]] std::string recording_settings(const RecordJobCfg& job, Rollout& rollout);

}  // namespace mjsense
