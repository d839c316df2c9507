// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading recordings back: where the files are, the datasets of a trajectory, rows in pieces of
// bounded size.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "mjsense/hdf5/guard.h"
#include "mjsense/hdf5/h5.h"

namespace mjsense {

struct RecordedFile {
  std::filesystem::path path;
  std::string name;       // relative to what was asked for
  bool published = true;  // false: a finished episode that waits for its batch
};

// The trajectory files at or below `path`, sorted; of a house that is being recorded, or repaired,
// only what is published, for the rest moves at any moment. Throws ValueError when there is no such path or
// nothing recorded in it.
std::vector<RecordedFile> recorded_files(const std::filesystem::path& path);
// The houses at or below `path` (or around it, when it is a file).
std::vector<std::filesystem::path> recorded_houses(const std::filesystem::path& path);

// "traj_0", "traj_1" ... in the order of their numbers.
std::vector<std::string> trajectory_names(hid_t file);

// A dataset with one row a step. What it claims to be is checked before anything is read.
class RowDataset {
 public:
  RowDataset(hid_t parent, const std::string& path);
  std::int64_t rows() const { return dims_.empty() ? 1 : static_cast<std::int64_t>(dims_[0]); }
  std::int64_t row_size() const;  // elements
  std::uint64_t bytes() const { return bytes_; }
  bool scalar() const { return dims_.empty(); }
  bool is_json() const { return json_; }
  bool is_bool() const;
  bool is_number() const;
  std::string dtype() const;  // NumPy's name
  std::string shape() const;  // "(T, 7)"
  hid_t id() const { return id_; }

  // Calls visit(t, text) with each row of JSON text, without its padding.
  void each_text(const std::function<void(std::int64_t t, std::string_view text)>& visit) const;
  // Calls visit(bytes) with pieces of all elements, in order, as the file has them.
  void each_bytes(const std::function<void(std::string_view bytes)>& visit) const;
  // Calls visit(values) with pieces of all elements, in order; bool as 0 and 1.
  void each_number(const std::function<void(std::span<const double> values)>& visit) const;

 private:
  void read(std::int64_t first, std::int64_t count, hid_t memory, void* out) const;
  std::int64_t rows_at_once(std::size_t element_bytes) const;

  std::string path_;
  h5::Id id_, type_;
  std::vector<hsize_t> dims_;
  std::uint64_t bytes_ = 0;  // of all rows
  bool json_ = false;
  mutable bool checked_ = false;  // its chunks, before the first row is read
};

// The name of a video in obs/sensor_data. Throws RuntimeError unless it is a plain name.
std::string read_file_name(hid_t sensor_data, const std::string& key);

}  // namespace mjsense
