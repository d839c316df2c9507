// SPDX-License-Identifier: Apache-2.0
#pragma once
// Maps a suite to files: datasets, videos, file names and batches. All functions are pure.
// molmospaces.h defines the paths in the HDF5 tree.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/record/json_rows.h"
#include "mjsense/record/recording.h"

namespace mjsense::record {

// One dataset with one row per step: one field of a sensor, all its fields as JSON text, or the
// constant `true`.
struct ArrayStream {
  const Sensor* sensor = nullptr;
  SensorSpec spec;                       // of the dataset
  const Field* field = nullptr;          // null: text, or constant
  std::shared_ptr<const JsonRows> text;  // text of all fields, or null
  const Field* present = nullptr;        // bool; the row is NaN where it is false. Null: no flag
  std::string path;                      // path in the trajectory's group: "obs/extra/tcp_pose"
  std::int64_t chunk_rows = 1;

  std::string_view kind() const;   // "json", or the sensor's kind
  std::size_t row_bytes() const;   // on disk, before compression
  std::size_t kept_bytes() const;  // of a row in the buffers, before it is written
};

enum class VideoKind { kRgb, kDepth16, kDepthRedGreen };

// One video file of one field of a sensor. A depth field has a second one if MolmoSpaces' encoding
// is requested.
struct VideoStream {
  const Sensor* sensor = nullptr;
  const Field* field = nullptr;
  VideoKind kind = VideoKind::kRgb;
  std::string key;        // dataset in obs/sensor_data: "wrist_camera"
  std::string stem;       // in file names: "wrist_camera"
  std::string extension;  // ".mp4", ".mkv"
  int width = 0, height = 0;
  std::size_t frame_bytes() const;  // in the encoder's input format
  std::string_view codec() const { return kind == VideoKind::kDepth16 ? "ffv1" : "h264"; }
  std::string_view container() const { return extension == ".mkv" ? "Matroska" : "MP4"; }
};

struct RecordingPlan {
  std::vector<ArrayStream> arrays;
  std::vector<VideoStream> videos;
  // JSON text of everything that must be equal for a recording to be resumed
  std::string fingerprint;
};

// Assigns a path to every field of every sensor. Throws ValueError if two streams would share a
// path, if the path of one would be inside that of another, if a name is not a valid path, or if a
// video stream is not uint8 [H, W, 3] or float32 [H, W].
RecordingPlan plan_recording(const RecordingCfg& cfg);

std::int64_t chunk_rows(std::size_t row_bytes);

// The episodes of each batch. Sizes differ by at most one; larger batches come first.
struct Batches {
  int episodes = 0, count = 0;
  std::int64_t first(int batch) const;  // position of its first episode; first(count) == episodes
  int size(int batch) const { return static_cast<int>(first(batch + 1) - first(batch)); }
};
Batches batches_of(int episodes, int batches);

std::string batch_file(int batch, int batches);  // batch from 0
// Final name of the video `name` of an episode: "episode_00000007_wrist_camera.mp4". It depends on
// nothing else, so an episode has the same files in whichever recording it is attempted.
std::string video_file(std::int64_t episode, std::string_view name);
// Group of the data for replay.
inline constexpr std::string_view kReplayGroup = "replay/";
constexpr std::size_t kFileNameBytes = 100;  // width of a file name in obs/sensor_data

// Spec of a dataset as JSON text, which is stored as its attribute.
std::string spec_json(std::string_view sensor, std::string_view kind, const SensorSpec& spec);

// Describes how two fingerprints differ: "'episodes' was 8 and is now 10". "" if they are equal.
std::string fingerprint_difference(const std::string& was, const std::string& now);

}  // namespace mjsense::record
