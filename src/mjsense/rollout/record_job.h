#pragma once
// The main job: episodes of a task, played in B worlds, kept on disk.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "mjsense/record/recorder.h"
#include "mjsense/rollout/rollout.h"

namespace mjsense {

struct RecordJobCfg {
  RolloutCfg rollout;
  std::filesystem::path out;
  int episodes = 1;            // to keep
  int max_attempts = 0;        // 0: six times as many, as MolmoSpaces
  bool keep_failures = false;  // else only successes count and stay
  bool resume = false;
  int house = 0;
  int batches = 0;  // files; 0: as MolmoSpaces does
  int gzip = 4;
  VideoCfg video;
};

// Worlds take attempts 0, 1, 2 ... as they become free. Which attempts are kept, and every byte of
// them, depends on seed and number alone: not on the number of worlds, threads, or an interruption.
struct RecordProgress {
  int kept = 0, wanted = 0, running = 0;
  int succeeded = 0, failed = 0;  // attempts of this run
  std::int64_t steps = 0;         // control steps of this run, all worlds
  std::int64_t physics_steps = 0;
  std::int64_t frames = 0;         // pictures recorded, all cameras
  double seconds = 0;              // wall
  double mean_length = 0;          // steps of a kept episode of this run
  std::int64_t running_steps = 0;  // that the running attempts have taken
  double seconds_left() const;     // NaN until an episode was kept
};

struct RecordSummary {
  RecordProgress progress;
  bool interrupted = false;
  bool enough = false;                  // all wanted episodes are there
  std::map<std::string, int> failures;  // why attempts failed, and how often
  std::vector<int> lengths;             // observations of each attempt that ended
  RolloutTimes times;
  double recording_s =
      0;  // wall seconds in the recorder: copying, and waiting for encoders and the disk
  RecordStats record;
  std::filesystem::path house_dir;
};

// 0: go on. 1: start no more episodes, finish those that run. 2: abandon them, keep what is
// finished.
using StopFlag = std::atomic<int>;

// Calls `progress` about ten times a second. Throws as Rollout and Recorder do.
RecordSummary record_episodes(const RecordJobCfg& cfg,
                              const std::function<void(const RecordProgress&)>& progress = {},
                              const StopFlag* stop = nullptr);

}  // namespace mjsense
