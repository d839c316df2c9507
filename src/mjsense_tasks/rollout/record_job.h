// SPDX-License-Identifier: Apache-2.0
#pragma once
// Records episodes of a task, played in B worlds, to disk.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "mjsense/core/fields/path_field.h"
#include "mjsense/record/recorder.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {

struct RecordJobCfg : record::FilesCfg {
  RecordJobCfg() { rollout.num_worlds = 4; }
  RolloutCfg rollout;
  std::filesystem::path out;
  int max_attempts = 0;
  int num_attempts = 0, first_attempt = 0;
  std::vector<int> attempts;
  std::string shard;  // "2/8"; "": not a shard
  bool keep_failures = false;
  bool replay = true;
  bool videos = true;
};
template <class V>
void visit_fields(V& v, RecordJobCfg& c) {
  v.object("RecordJobCfg", "A recording of episodes.");
  v.include(c.rollout);
  v("out", c.out, "Output directory.");
  v.include(static_cast<record::FilesCfg&>(c));
  v("max_attempts", c.max_attempts,
    "Maximum number of episodes to attempt; 0: six times the number to keep.")
      .at_least(0);
  v("num_attempts", c.num_attempts,
    "Play exactly this number of attempts instead of ending at a number of kept episodes; 0: do "
    "not.")
      .at_least(0);
  v("first_attempt", c.first_attempt, "Number of the first attempt.").at_least(0);
  v("attempts", c.attempts,
    "Numbers of the attempts to play, in ascending order, instead of ``first_attempt`` and "
    "``num_attempts``.");
  v("shard", c.shard,
    "``k/n``, k from 0: play only part k of n of the attempts, in the directory ``shard_k`` of the "
    "output directory; requires ``num_attempts``, the number of attempts of all shards.");
  v("keep_failures", c.keep_failures, "Keep failed episodes too.").decides_data();
  v("replay", c.replay,
    "Store what replay needs: the model, and the simulation's state and controls of every step.");
  v("videos", c.videos,
    "Store the images of the cameras as videos. Without them, ``mjsense render`` makes the videos "
    "of "
    "chosen episodes afterwards.");
}

// A job without `shard`: that part of the attempts, in its own directory. The shards are contiguous
// and their sizes differ by at most one; larger ones come first. Throws ValueError for an invalid
// shard.
RecordJobCfg without_shard(RecordJobCfg job);

// Seed of the episodes of a house: `seed` itself for house 0, otherwise a hash of both.
std::uint64_t seed_of_house(std::uint64_t seed, int house);

// Progress of a recording. Worlds take the attempts in order as they become free. Which attempts
// are kept, and every byte of them, depends only on the seed, the house and the attempt's number,
// not on the number of worlds, threads or interruptions, or on the shard.
struct RecordProgress {
  int kept = 0, wanted = 0, running = 0;
  int succeeded = 0, failed = 0;  // attempts of this run
  std::int64_t steps = 0;         // control steps of this run, all worlds
  std::int64_t physics_steps = 0;
  std::int64_t frames = 0;         // images recorded, all cameras
  double seconds = 0;              // wall-clock time
  double mean_length = 0;          // mean number of steps of this run per kept episode
  std::int64_t running_steps = 0;  // steps that the running attempts have taken
  double seconds_left() const;     // NaN until an episode is kept
};

struct RecordSummary {
  RecordProgress progress;
  bool interrupted = false;
  bool enough = false;                  // all wanted episodes are kept, or all attempts decided
  std::map<std::string, int> failures;  // number of failed attempts by reason
  std::vector<int> lengths;             // number of observations of each ended attempt
  RolloutTimes times;
  double recording_s =
      0;  // wall seconds in the recorder: copying, and waiting for encoders and the disk
  record::RecordStats record;
  std::filesystem::path house_dir;
  std::vector<std::string> damage;  // see Recorder::damage()
};

// 0: continue. 1: start no more episodes and finish the running ones. 2: abandon running episodes
// and keep the finished ones.
using StopFlag = std::atomic<int>;

// Calls `progress` about ten times per second. Throws the errors of Rollout and Recorder.
RecordSummary record_episodes(const RecordJobCfg& cfg,
                              const std::function<void(const RecordProgress&)>& progress = {},
                              const StopFlag* stop = nullptr);

}  // namespace mjsense::tasks::rollout
