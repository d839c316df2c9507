#pragma once
// What a recording is: which sensors, how many episodes, where and how they are kept.
// docs/formats.md shows the files.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace mjsense {

class Sensor;

// Frames a second, exact: a policy period of 66 ms is 500/33, which no decimal number is.
struct Fps {
  std::int64_t num = 30;
  std::int64_t den = 1;

  static Fps from_period_ms(std::int64_t policy_dt_ms);  // throws ValueError unless positive
  double value() const { return static_cast<double>(num) / static_cast<double>(den); }
  std::string str() const;  // "500/33"
  bool operator==(const Fps&) const = default;
};

struct VideoCfg {
  std::string ffmpeg;  // the program; "": $MJSENSE_FFMPEG, else "ffmpeg" of PATH
  // ffmpeg processes at one time; 0: 32. Streams beyond them wait in raw files on disk.
  int max_encoders = 0;
  // Frames of a stream that wait in memory; when they are full, append() waits.
  int queue_frames = 3;
  // Per encoder. The bytes of a video depend on it, so it is never taken from the machine.
  int threads = 1;
  int crf = 24;                     // x264 quality: 0 lossless .. 51
  std::string preset = "veryfast";  // x264 effort; docs/formats.md has the figures
  int keyint = 250;                // most frames between key frames: fewer seek faster, more shrink
  double depth_unit = 0.0002;      // metres per unit of the 16-bit depth video; reaches to 13.1 m
  bool molmospaces_depth = false;  // also MolmoSpaces' lossy red-green depth MP4, for its loaders
};

struct RecordingCfg {
  std::filesystem::path out_dir;
  int house = 0;     // {out_dir}/house_{house}/
  int episodes = 1;  // episodes to keep
  // Files they are spread over; 0: max(1, round(episodes / 4)), as MolmoSpaces does.
  int batches = 0;
  int num_worlds = 1;
  Fps fps;
  // The suite, in its order. Initialized; they outlive the recorder. Every field is on disk.
  std::vector<const Sensor*> sensors;
  // JSON text of what made the data (task, robot, seed ...): kept in every file; a recording can
  // only be resumed with the same.
  std::string settings = "{}";
  bool resume = false;  // go on with what is there; else existing output is an error
  int gzip = 4;         // 0: no compression .. 9
  VideoCfg video;
};

// One attempt. Numbers start at 0 and leave no gap: they, and not the order of finishing, give the
// order on disk, so that the files do not depend on the number of worlds or on an interruption.
struct EpisodeMeta {
  std::int64_t episode = 0;
  std::uint64_t seed = 0;
};

// What belongs to a step beside the sensors' rows.
struct StepRow {
  float reward = 0;
  bool terminated = false;
  bool truncated = false;
  bool success = false;
};

}  // namespace mjsense
