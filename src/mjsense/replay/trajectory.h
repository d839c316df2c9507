// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads recordings: finds the files and the data sets of a trajectory, and reads rows in chunks of
// bounded size.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "mjsense/hdf5/h5.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::replay {

struct RecordedFile {
  std::filesystem::path path;
  std::string name;       // relative to the path that was given
  bool published = true;  // false: a finished episode that is not yet in a published batch
};

// Returns the trajectory files at or below `path`, sorted. For a house that is being recorded or
// repaired, returns published files only, because others may be moved at any time. Throws
// ValueError if the path does not exist or contains no recording.
std::vector<RecordedFile> recorded_files(const std::filesystem::path& path);
// Returns the houses at or below `path`, or the house that contains it if it is a file.
std::vector<std::filesystem::path> recorded_houses(const std::filesystem::path& path);

// Returns "traj_0", "traj_1" ... in numerical order.
std::vector<std::string> trajectory_names(hid_t file);

// A data set with one row per step. Its header is validated before any data is read.
class RowDataset {
 public:
  RowDataset(hid_t parent, const std::string& path);
  std::int64_t rows() const { return dims_.empty() ? 1 : static_cast<std::int64_t>(dims_[0]); }
  std::int64_t row_size() const;  // in elements
  std::uint64_t bytes() const { return bytes_; }
  bool scalar() const { return dims_.empty(); }
  bool is_json() const { return json_; }
  bool is_bool() const;
  bool is_number() const;
  std::string dtype() const;  // NumPy's name
  std::string shape() const;  // "(T, 7)"
  hid_t id() const { return id_; }

  // Calls visit(t, text) with the JSON text of each row, without its padding.
  void each_text(const std::function<void(std::int64_t t, std::string_view text)>& visit) const;
  // Calls visit(bytes) with chunks of all elements, in order, in the file's representation.
  void each_bytes(const std::function<void(std::string_view bytes)>& visit) const;
  // Calls visit(values) with chunks of all elements, in order; bool as 0 and 1.
  void each_number(const std::function<void(std::span<const double> values)>& visit) const;

 private:
  void read(std::int64_t first, std::int64_t count, hid_t memory, void* out) const;
  std::int64_t rows_at_once(std::size_t element_bytes) const;

  std::string path_;
  hdf5::Id id_, type_;
  std::vector<hsize_t> dims_;
  std::uint64_t bytes_ = 0;  // of all rows
  bool json_ = false;
  // whether the chunks were validated, which precedes the first read
  mutable bool checked_ = false;
};

// Reads the name of a video from obs/sensor_data. Throws RuntimeError unless it is a plain name.
std::string read_file_name(hid_t sensor_data, const std::string& key);

}  // namespace mjsense::replay
