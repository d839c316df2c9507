// SPDX-License-Identifier: Apache-2.0
#pragma once
// Configuration of a recording: sensors, number of episodes, location and file formats.
// docs/formats.md describes the files.

#include <mujoco/mujoco.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mjsense/core/array.h"

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

struct VideoCfg {
  std::string ffmpeg;
  int max_encoders = 0;
  int queue_frames = 3;
  int threads = 1;
  int crf = 25;
  std::string preset = "veryfast";
  std::string tune = "fastdecode";
  int keyint = 20;
  double depth_unit = 0.0002;
  double ffmpeg_timeout = 60;
  bool molmospaces_depth = false;
};
template <class V>
void visit_fields(V& v, VideoCfg& c) {
  v.object("VideoCfg", "How images are stored.");
  v("ffmpeg", c.ffmpeg,
    "Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.");
  v("crf", c.crf, "Quality of the videos, from 0 (lossless) to 51 (worst).").within(0, 51);
  v("preset", c.preset,
    "Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.");
  v("tune", c.tune,
    "Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and "
    "files are a seventh larger.");
  v("keyint", c.keyint,
    "Maximum number of frames between key frames. A small value makes random access faster, a "
    "large value makes files smaller.")
      .at_least(1);
  v("molmospaces_depth", c.molmospaces_depth,
    "Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video.");
  v("max_encoders", c.max_encoders,
    "Maximum number of concurrent ffmpeg processes; 0: 32. Further streams wait in raw files on "
    "disk.")
      .at_least(0)
      .hidden();
  v("queue_frames", c.queue_frames,
    "Number of frames of a stream that are buffered in memory; when the buffer is full, the "
    "simulation waits.")
      .at_least(1)
      .hidden();
  v("encoder_threads", c.threads,
    "Number of threads of each encoder. The bytes of a video depend on it, so it does not follow "
    "the number of CPUs.")
      .at_least(1)
      .hidden();
  v("ffmpeg_timeout", c.ffmpeg_timeout,
    "Time after which an ffmpeg process that accepts no frame, or does not finish, is killed.")
      .unit("s")
      .positive()
      .hidden();
  v("depth_unit", c.depth_unit,
    "Unit of the 16-bit depth video; 0.0002 m covers distances up to 13.1 m.")
      .unit("m")
      .positive()
      .hidden();
}

struct RecordingCfg {
  std::filesystem::path out_dir;
  int house = 0;     // {out_dir}/house_{house}/
  int episodes = 1;  // episodes to keep
  // Number of HDF5 files; 0: max(1, round(episodes / 4)), as in MolmoSpaces.
  int batches = 0;
  int num_worlds = 1;
  Fps fps;
  // Initialized sensors, in the order of the suite. They must outlive the recorder. All their
  // fields are recorded.
  std::vector<const Sensor*> sensors;
  // JSON text of the settings that produced the data (task, robot, seed ...). It is stored in every
  // file, and a recording can only be resumed with equal settings.
  std::string settings = "{}";
  // Compiled model, or null. Its checksums are stored in every file, and a recording cannot be
  // resumed with another model.
  const mjModel* model = nullptr;
  bool resume = false;  // continue an existing recording; otherwise existing output is an error
  // Add to a completed recording with the same settings: the numbers of attempts and of HDF5 files
  // follow those that exist.
  bool append = false;
  bool overwrite = false;  // remove an existing recording first
  // Number of the first attempt. Attempts before it are not part of this recording. `append` sets
  // it.
  std::int64_t first_attempt = 0;
  std::int64_t num_attempts = 0;  // number of attempts, if it is fixed; 0: it is not
  int first_batch = 0;            // HDF5 files of the recordings that `append` continues; set by it
  int gzip = 4;                   // compression level, 0 (none) to 9
  // File for replay, stored in the house once: its name, "model_1a2b3c4d.zip", and its bytes. Empty:
  // none. Recordings with the same model have the same name.
  std::string archive_name, archive;
  VideoCfg video;
  // At 2 or more the user wants to stop immediately: a hanging ffmpeg gets 2 s instead of
  // ffmpeg_timeout.
  const std::atomic<int>* stop = nullptr;
};

// One attempt. Episode numbers start at RecordingCfg::first_attempt without gaps. They, and not the
// order in which episodes finish, determine the order on disk, so the files do not depend on the
// number of worlds or on interruptions.
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
