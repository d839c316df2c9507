// SPDX-License-Identifier: Apache-2.0
#pragma once
// Configuration of a recording: sensors, location and files.
// docs/formats.md describes the files.

#include <mujoco/mujoco.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/record/files_cfg.h"

namespace mjsense {
class Sensor;
}  // namespace mjsense

namespace mjsense::record {

// Frames per second as an exact fraction: a policy period of 66 ms is 500/33 frames per second,
// which has no finite decimal representation.
struct Fps {
  std::int64_t num = 30;
  std::int64_t den = 1;

  static Fps from_period_ms(std::int64_t policy_dt_ms);  // throws ValueError unless positive
  double value() const { return static_cast<double>(num) / static_cast<double>(den); }
  std::string str() const;  // "500/33"
  bool operator==(const Fps&) const = default;
};

struct RecordingCfg : FilesCfg {
  std::filesystem::path out_dir;
  int num_worlds = 1;
  Fps fps;
  // Initialized sensors, in the order of the suite. They must outlive the recorder. All their
  // fields are recorded.
  std::vector<const Sensor*> sensors;
  bool videos = true;  // false: fields that would be videos are left out
  // JSON text of the settings that produced the data (task, robot, seed ...). It is stored in every
  // file, and a recording can only be resumed with equal settings.
  std::string settings = "{}";
  // Compiled model, or null. Its checksums are stored in every file, and a recording cannot be
  // resumed with another model.
  const mjModel* model = nullptr;
  // Number of the first attempt. Attempts before it are not part of this recording. `append` sets
  // it.
  std::int64_t first_attempt = 0;
  std::int64_t num_attempts = 0;  // number of attempts, if it is fixed; 0: it is not
  // The numbers of the attempts, in ascending order, if they have gaps; the first is first_attempt.
  std::vector<std::int64_t> attempts;
  int first_batch = 0;  // HDF5 files of the recordings that `append` continues; set by it
  // File for replay, stored in the house once: its name, "model_1a2b3c4d.zip", and its bytes. Empty:
  // none. Recordings with the same model have the same name.
  std::string archive_name, archive;
  // At 2 or more the user wants to stop immediately: a hanging ffmpeg gets 2 s instead of
  // ffmpeg_timeout.
  const std::atomic<int>* stop = nullptr;
};

// One attempt. Episode numbers start at RecordingCfg::first_attempt without gaps, unless
// RecordingCfg::attempts lists them. They, and not the order in which episodes finish, determine the
// order on disk, so the files do not depend on the number of worlds or on interruptions.
struct EpisodeMeta {
  std::int64_t episode = 0;
  std::uint64_t seed = 0;
};

// An array of an episode that does not depend on the step: traj_{i}/replay/{path}.
struct EpisodeArray {
  std::string path;  // "model/geom_size", "held"
  std::string description;
  std::string unit, frame;
  DType dtype = DType::kFloat64;
  Shape shape;
  std::vector<std::byte> values;
};

// A recorded episode whose data are carried over into a new one: every dataset of the trajectory that
// the new episode does not have, with its attributes, and the videos that these datasets name.
struct EpisodeSource {
  std::filesystem::path file;
  std::string trajectory;         // "traj_0"
  std::vector<std::string> skip;  // datasets and groups that are left out: "obs/sensor_data"
};

// Data of a step in addition to the sensors' rows.
struct StepRow {
  float reward = 0;
  bool terminated = false;
  bool truncated = false;
  bool success = false;
};

}  // namespace mjsense::record
