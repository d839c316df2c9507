// SPDX-License-Identifier: Apache-2.0
#pragma once
// Everything that the data of a recording depend on, as JSON text: each field that is declared to
// affect the data, the resolved values of fields that default to the robot or the task, and
// checksums of the robot's and the scene's files and of user code. A recording can only be resumed
// with equal settings. The numbers of worlds and threads are not included.

#include <string>

#include "mjsense_tasks/rollout/record_job.h"

namespace mjsense::tasks::rollout {

// Throws ValueError if `job` resumes a recording with a user-defined task, policy or scene whose
// dependencies are unknown (RolloutCfg::code).
[[nodiscard]] std::string recording_settings(const RecordJobCfg& job, Rollout& rollout);

}  // namespace mjsense::tasks::rollout
