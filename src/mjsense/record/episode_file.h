// SPDX-License-Identifier: Apache-2.0
#pragma once
// The HDF5 file of one episode while it is recorded: `traj_0` of a file of its own. Used by one
// thread; the plan outlives it.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/hdf5/h5.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/layout.h"

namespace mjsense {

// What the recorder adds to every step; the places of these datasets stand beside the suite's.
enum OwnStream { kRewards, kSuccess, kFail, kTerminated, kTruncated, kOwnStreams };
std::string_view own_place(int stream);
DType own_dtype(int stream);

class EpisodeFile {
 public:
  // The file `name` of a folder.
  EpisodeFile(std::shared_ptr<const Folder> folder, const std::string& name,
              const RecordingCfg& cfg, const RecordingPlan& plan, const EpisodeMeta& meta);
  ~EpisodeFile();
  EpisodeFile(const EpisodeFile&) = delete;
  EpisodeFile& operator=(const EpisodeFile&) = delete;

  // Appends `rows` rows of a stream: streams [0, arrays) are the plan's, then OwnStream. `chunk`
  // has the kept bytes of a whole chunk, zero beyond the rows: what is text on disk becomes it
  // here. Chunks of a stream come in order, all but the last full.
  void write_chunk(int stream, std::int64_t rows, std::span<const std::uint8_t> chunk);
  void write_scene(std::string_view obs_scene, std::string_view outcome);
  // Of the videos, in the plan's order: their checksums and sizes. Closes; throws when the disk
  // refuses.
  struct VideoSum {
    std::string crc;
    std::int64_t bytes = 0;
  };
  void finish(std::span<const VideoSum> videos);

 private:
  struct Dataset {
    h5::Id id, crc;  // the dataset, and its attribute of that name
    int rank = 0;
    std::size_t row_bytes = 0;
    Checksum sum;  // of all rows
    hsize_t dims[Shape::kMaxRank + 1] = {};
  };
  // A chunk of texts; valid until the next call.
  std::span<const std::uint8_t> texts_of(const ArrayStream& stream, std::int64_t rows,
                                         std::span<const std::uint8_t> kept);
  void add_dataset(std::string_view place, DType dtype, const Shape& row, std::int64_t chunk_rows);

  std::shared_ptr<const Folder> folder_;
  std::string name_;
  int gzip_;
  const RecordingPlan& plan_;
  h5::Id file_, trajectory_;
  std::vector<Dataset> datasets_;
  std::vector<std::uint8_t> texts_, packed_;
};

}  // namespace mjsense
