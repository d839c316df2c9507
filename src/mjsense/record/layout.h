#pragma once
// Where everything stands: the place of a stream in the HDF5 tree, the names of files, the batches.
// Pure functions.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/record/recording.h"

namespace mjsense {

// One field of one sensor that becomes one dataset with a row a step.
struct ArrayStream {
  const Sensor* sensor = nullptr;
  const Field* field = nullptr;
  std::string place;  // "obs/extra/tcp_pose"
  std::int64_t chunk_rows = 1;
};

enum class VideoKind { kRgb, kDepth16, kDepthRedGreen };

// One field of one sensor that becomes one video file. A depth field becomes two when MolmoSpaces'
// form is asked for.
struct VideoStream {
  const Sensor* sensor = nullptr;
  const Field* field = nullptr;
  VideoKind kind = VideoKind::kRgb;
  std::string key;        // dataset in obs/sensor_data: "wrist_camera"
  std::string stem;       // in file names: "wrist_camera"
  std::string extension;  // ".mp4", ".mkv"
  int width = 0, height = 0;
  std::size_t frame_bytes() const;  // as the encoder reads it
};

struct RecordingPlan {
  std::vector<ArrayStream> arrays;
  std::vector<VideoStream> videos;
  std::string fingerprint;  // what two recordings must share to be one: JSON text
};

// Finds the place of every field of every sensor. Throws ValueError when two streams would share a
// place, when one would stand inside the other, when a name is no path, and when a video stream is
// not uint8 [H, W, 3] or float32 [H, W].
RecordingPlan plan_recording(const RecordingCfg& cfg);

// "qpos" -> "obs/agent/qpos", "feet/force" -> "obs/extra/feet/force" ...
std::string place_of(std::string_view stream);
std::int64_t chunk_rows(std::size_t row_bytes);

// Episodes of each batch: sizes differ by one at most, the larger first.
std::vector<int> batch_sizes(int episodes, int batches);

std::string batch_file(int batch, int batches);  // batch from 0
std::string video_file(const VideoStream& video, int index, int batch, int batches);  // final name
std::string video_file(std::string_view stem, std::string_view extension, int index, int batch,
                       int batches);
constexpr std::size_t kFileNameBytes = 100;  // width of a file name in obs/sensor_data

// Groups that every episode has, empty or not.
std::span<const char* const> standard_groups();

// The spec of a stream as JSON text: an attribute of its dataset.
std::string spec_json(const Sensor& sensor, const SensorSpec& spec);

// Of two fingerprints: "" if equal, else "'episodes' was 8 and is now 10".
std::string fingerprint_difference(const std::string& was, const std::string& now);

}  // namespace mjsense
