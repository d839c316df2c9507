// SPDX-License-Identifier: Apache-2.0
#pragma once
// What becomes of a suite on disk: datasets and videos, the names of files, the batches. Pure
// functions; the places in the HDF5 tree are molmospaces.h.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/record/json_rows.h"
#include "mjsense/record/recording.h"

namespace mjsense {

// One dataset with a row a step: a field of a sensor as it is, or all of them as JSON text.
struct ArrayStream {
  const Sensor* sensor = nullptr;
  SensorSpec spec;                       // of the dataset
  const Field* field = nullptr;          // null if it is text of many
  std::shared_ptr<const JsonRows> text;  // null if it is a field
  const Field* present = nullptr;        // bool: where it is false the row is NaN; null: never
  std::string place;                     // "obs/extra/tcp_pose"
  std::int64_t chunk_rows = 1;

  std::string_view kind() const;   // "json", or the sensor's
  std::size_t row_bytes() const;   // on disk, before compression
  std::size_t kept_bytes() const;  // of a row until it is written
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

// Finds a place for every field of every sensor. Throws ValueError when two streams would share a
// place, when one would stand inside the other, when a name is no path, and when a video stream is
// not uint8 [H, W, 3] or float32 [H, W].
RecordingPlan plan_recording(const RecordingCfg& cfg);

std::int64_t chunk_rows(std::size_t row_bytes);

// Episodes of each batch: sizes differ by one at most, the larger first.
std::vector<int> batch_sizes(int episodes, int batches);

// The same without a list of them: which episodes are in which batch.
struct Batches {
  int episodes = 0, count = 0;
  std::int64_t first(int batch) const;  // position of its first episode; of `count`: `episodes`
  int size(int batch) const { return static_cast<int>(first(batch + 1) - first(batch)); }
};
Batches batches_of(int episodes, int batches);

std::string batch_file(int batch, int batches);  // batch from 0
std::string video_file(const VideoStream& video, int index, int batch, int batches);  // final name
std::string video_file(std::string_view stem, std::string_view extension, int index, int batch,
                       int batches);
constexpr std::size_t kFileNameBytes = 100;  // width of a file name in obs/sensor_data

// The spec of a dataset as JSON text: an attribute of it.
std::string spec_json(std::string_view sensor, std::string_view kind, const SensorSpec& spec);

// Of two fingerprints: "" if equal, else "'episodes' was 8 and is now 10".
std::string fingerprint_difference(const std::string& was, const std::string& now);

}  // namespace mjsense
