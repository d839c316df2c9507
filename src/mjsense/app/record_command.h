// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense record`: options, configuration file, progress, summary.

#include <string>
#include <vector>

#include "mjsense_tasks/rollout/record_job.h"

namespace mjsense::app {

struct RecordOptions {
  tasks::rollout::RecordJobCfg job;
  bool json = false;
  bool quiet = false;
  bool sheet = true;  // write the contact sheet
  bool tree = true;   // print the tree of the files
};

// Exit code: 0 all wanted episodes are on disk, 1 some are not.
int run_record(const RecordOptions& options);

}  // namespace mjsense::app
