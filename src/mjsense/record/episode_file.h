// SPDX-License-Identifier: Apache-2.0
#pragma once
// The HDF5 file of one running episode, which contains the single trajectory `traj_0`. It is used
// by one thread, and the plan must outlive it.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/hdf5/h5.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/image_histogram.h"
#include "mjsense/record/recording_plan.h"

namespace mjsense::record {

// Streams that the recorder adds to those of the suite.
enum OwnStream { kRewards, kSuccess, kFail, kTerminated, kTruncated, kOwnStreams };
std::string_view own_path(int stream);
DType own_dtype(int stream);
std::string_view own_description(int stream);

class EpisodeFile {
 public:
  // Creates the file `name` in `folder`.
  EpisodeFile(std::shared_ptr<const Folder> folder, const std::string& name,
              const RecordingCfg& cfg, const RecordingPlan& plan, const EpisodeMeta& meta);
  ~EpisodeFile();
  EpisodeFile(const EpisodeFile&) = delete;
  EpisodeFile& operator=(const EpisodeFile&) = delete;

  // Appends `rows` rows to a stream. Streams [0, arrays) are those of the plan; the OwnStream
  // values follow. `chunk` is the buffer of a whole chunk (kept_bytes() per row), zero beyond the
  // rows; JSON text is generated from it here. The chunks of a stream must come in order, and all
  // but the last must be full.
  void write_chunk(int stream, std::int64_t rows, std::span<const std::uint8_t> chunk);
  // `steps`: policy steps of the episode, which is one less than its observations.
  void write_scene(std::string_view obs_scene, std::string_view outcome, std::int64_t steps);
  void write_array(const EpisodeArray& array);
  // Stores the levels of all frames of a colour video: an attribute of the dataset of its name.
  void write_histogram(const VideoStream& video, const ImageHistogram& histogram);
  // Copies what this file does not have yet. Throws RuntimeError if the source cannot be read.
  void carry_over(const EpisodeSource& source);
  // Checksums and sizes of the videos, in the order of the plan. finish() writes them and closes
  // the file; it throws if the disk reports an error.
  struct VideoSum {
    std::string crc;
    std::int64_t bytes = 0;
  };
  void finish(std::span<const VideoSum> videos);

 private:
  struct Dataset {
    hdf5::Id id, crc;  // the dataset and its checksum attribute
    int rank = 0;
    std::size_t row_bytes = 0;
    Checksum sum;  // of all rows
    hsize_t dims[Shape::kMaxRank + 1] = {};
  };
  // Returns a chunk converted to text; valid until the next call.
  std::span<const std::uint8_t> texts_of(const ArrayStream& stream, std::int64_t rows,
                                         std::span<const std::uint8_t> kept);
  // Copies the video that the dataset `path` names, and names the copy.
  void carry_video(const std::filesystem::path& folder, const std::string& path);
  void add_dataset(std::string_view path, DType dtype, const Shape& row, std::int64_t chunk_rows);

  std::shared_ptr<const Folder> folder_;
  std::string name_;
  int gzip_;
  const RecordingPlan& plan_;
  hdf5::Id file_, trajectory_;
  std::vector<Dataset> datasets_;
  std::vector<std::uint8_t> texts_;
};

}  // namespace mjsense::record
