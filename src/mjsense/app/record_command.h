#pragma once
// `mjsense record`: options, configuration file, progress, summary.

#include <string>
#include <vector>

#include "mjsense/rollout/record_job.h"

namespace mjsense {

struct RecordOptions {
  RecordOptions() { job.rollout.num_worlds = 4; }
  RecordJobCfg job;
  bool json = false;
  bool quiet = false;
  bool sheet = true;  // write the contact sheet
};

// The names of options in a configuration file: those of the command line, with '-' as '_'.
// Reads TOML into `options`; throws ValueError "x.toml:3: no key named 'episods'; did you mean
// 'episodes'?".
void read_config(const std::string& path, RecordOptions& options);

// "640x368" -> width, height. Throws ValueError.
void parse_size(const std::string& text, RolloutCfg& rollout);
// "wrist_camera,exo_camera_1" or "none". Throws ValueError.
void parse_cameras(const std::string& text, RolloutCfg& rollout);

// Exit code: 0 all wanted episodes are on disk, 1 some are not.
int run_record(const RecordOptions& options);

}  // namespace mjsense
