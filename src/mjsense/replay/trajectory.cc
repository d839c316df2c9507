// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/hdf5/chunk_checks.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/replay/json_text.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

constexpr std::size_t kPieceBytes = 1 << 22;
constexpr std::size_t kMaxNameBytes = 4096;
constexpr hsize_t kMinTextWidth =
    100;  // MolmoSpaces' dict rows have 1000 bytes or more, its other uint8 rows have 1

bool is_trajectory_file(const fs::path& path) {
  return path.extension() == ".h5" && path.filename().string().starts_with("trajectories");
}

void require_exists(const fs::path& path) {
  std::error_code error;
  const fs::file_status found = fs::status(path, error);
  if (!fs::exists(found)) throw ValueError(fmt::format("'{}' does not exist", path.string()));
  if (!fs::is_regular_file(found) && !fs::is_directory(found))
    throw ValueError(fmt::format("'{}' is neither a file nor a folder", path.string()));
}

// Converts errors of walking through folders (no permission, names that are too long) to a
// RuntimeError.
auto walk(const fs::path& path, auto&& steps) {
  try {
    return steps();
  } catch (const fs::filesystem_error& e) {
    throw RuntimeError(
        fmt::format("cannot list the contents of '{}': {}", path.string(), e.code().message()));
  }
}

}  // namespace

std::vector<RecordedFile> recorded_files(const fs::path& path) {
  require_exists(path);
  std::vector<RecordedFile> files;
  if (fs::is_regular_file(path)) {
    files.push_back({path, path.filename().string(), path.filename() != record::kEpisodeFile});
    return files;
  }
  for (const fs::path& house : recorded_houses(path)) {
    const auto add = [&](const fs::path& file, bool published) {
      const std::string name = house == path ? file.lexically_relative(house).string()
                                             : file.lexically_relative(path).string();
      files.push_back({file, name, published});
    };
    std::vector<fs::path> published;
    walk(house, [&] {
      for (const fs::directory_entry& entry : fs::directory_iterator(house)) {
        if (is_trajectory_file(entry.path())) published.push_back(entry.path());
      }
    });
    std::sort(published.begin(), published.end());
    for (const fs::path& file : published) add(file, true);
    if (record::is_locked(house)) continue;
    for (const fs::path& episode : record::finished_episodes(house))
      add(episode / record::kEpisodeFile, false);
  }
  return files;
}

std::vector<fs::path> recorded_houses(const fs::path& path) {
  require_exists(path);
  if (fs::is_regular_file(path)) return {path.parent_path()};
  const auto is_house = [](const fs::path& dir) {
    if (is_plain_folder(dir / record::kStagingDir)) return true;
    return std::any_of(fs::directory_iterator(dir), fs::directory_iterator(),
                       [](const fs::directory_entry& e) { return is_trajectory_file(e.path()); });
  };
  std::vector<fs::path> houses;
  walk(path, [&] {
    if (is_house(path)) houses.push_back(path);
    for (auto it = fs::recursive_directory_iterator(path); it != fs::recursive_directory_iterator();
         ++it) {
      if (!it->is_directory()) continue;
      if (it->path().filename() == record::kStagingDir) {
        it.disable_recursion_pending();
      } else if (is_house(it->path())) {
        houses.push_back(it->path());
      }
    }
  });
  if (houses.empty()) {
    throw ValueError(fmt::format("'{}' contains no recording: no trajectories_batch_*.h5 was found",
                                 path.string()));
  }
  std::sort(houses.begin(), houses.end());
  return houses;
}

std::vector<std::string> trajectory_names(hid_t file) {
  std::vector<std::string> names;
  for (std::string& name : hdf5::children(file)) {
    if (name.starts_with("traj_")) names.push_back(std::move(name));
  }
  const auto number = [](const std::string& name) { return std::atol(name.c_str() + 5); };
  std::sort(names.begin(), names.end(),
            [&](const auto& a, const auto& b) { return number(a) < number(b); });
  return names;
}

RowDataset::RowDataset(hid_t parent, const std::string& path)
    : path_(path),
      id_(hdf5::open_dataset(parent, path)),
      type_(H5Dget_type(id_), H5Tclose, path),
      dims_(hdf5::dims(id_)),
      bytes_(hdf5::check_storage(id_, path)) {
  const bool bytes = H5Tequal(type_, H5T_STD_U8LE) > 0 && dims_.size() == 2;
  const bool described = hdf5::has_attribute(id_, "spec");
  json_ = bytes &&
          (described ? hdf5::text_attribute(id_, "encoding") == "json" : dims_[1] >= kMinTextWidth);
}

std::int64_t RowDataset::row_size() const {
  // if one dimension is 0, the others may have any size
  if (std::find(dims_.begin(), dims_.end(), 0) != dims_.end()) return 0;
  std::int64_t size = 1;
  for (std::size_t i = 1; i < dims_.size(); ++i) size *= static_cast<std::int64_t>(dims_[i]);
  return size;
}

bool RowDataset::is_bool() const {
  return H5Tget_class(type_) == H5T_ENUM && H5Tget_size(type_) == 1 &&
         H5Tget_nmembers(type_) == 2 && H5Tget_member_index(type_, "TRUE") >= 0;
}

bool RowDataset::is_number() const {
  const H5T_class_t cls = H5Tget_class(type_);
  const bool plain = cls == H5T_FLOAT || cls == H5T_INTEGER;
  return (plain && H5Tget_size(type_) <= sizeof(double)) || is_bool();
}

std::string RowDataset::dtype() const {
  if (json_) return "json";
  if (is_bool()) return "bool";
  const std::size_t bits = 8 * H5Tget_size(type_);
  switch (H5Tget_class(type_)) {
    case H5T_FLOAT:
      return fmt::format("float{}", bits);
    case H5T_INTEGER:
      return fmt::format("{}int{}", H5Tget_sign(type_) == H5T_SGN_NONE ? "u" : "", bits);
    case H5T_STRING:
      return "text";
    default:
      return "other";
  }
}

std::string RowDataset::shape() const {
  if (dims_.empty()) return "()";
  std::string text = "(T";
  for (std::size_t i = 1; i < dims_.size(); ++i) text += fmt::format(", {}", dims_[i]);
  return text + (dims_.size() == 1 ? ",)" : ")");
}

std::int64_t RowDataset::rows_at_once(std::size_t element_bytes) const {
  const std::size_t row =
      std::max<std::size_t>(1, static_cast<std::size_t>(row_size()) * element_bytes);
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(kPieceBytes / row));
}

void RowDataset::read(std::int64_t first, std::int64_t count, hid_t memory, void* out) const {
  if (!std::exchange(checked_, true)) hdf5::check_chunks(id_, path_);
  if (dims_.empty())
    return hdf5::check(H5Dread(id_, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out), path_);
  std::vector<hsize_t> start(dims_.size(), 0), size = dims_;
  start[0] = static_cast<hsize_t>(first);
  size[0] = static_cast<hsize_t>(count);
  const hdf5::Id file(H5Dget_space(id_), H5Sclose, path_);
  hdf5::check(
      H5Sselect_hyperslab(file, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr),
      path_);
  const hdf5::Id buffer(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr),
                        H5Sclose, path_);
  hdf5::check(H5Dread(id_, memory, buffer, file, H5P_DEFAULT, out), path_);
}

void RowDataset::each_text(const std::function<void(std::int64_t, std::string_view)>& visit) const {
  const std::int64_t at_once = rows_at_once(1);
  const auto width = static_cast<std::size_t>(row_size());
  std::string piece;
  for (std::int64_t first = 0; first < rows(); first += at_once) {
    const std::int64_t count = std::min(at_once, rows() - first);
    piece.resize(width * static_cast<std::size_t>(count));
    read(first, count, H5T_NATIVE_UINT8, piece.data());
    for (std::int64_t i = 0; i < count; ++i)
      visit(first + i, trim_row(std::string_view(piece).substr(width * i, width)));
  }
}

void RowDataset::each_bytes(const std::function<void(std::string_view)>& visit) const {
  const std::size_t element = H5Tget_size(type_);
  const auto width = static_cast<std::size_t>(row_size()) * element;
  if (width == 0) return;
  const std::int64_t at_once = rows_at_once(element);
  std::string piece;
  for (std::int64_t first = 0; first < rows(); first += at_once) {
    const std::int64_t count = std::min(at_once, rows() - first);
    piece.resize(width * static_cast<std::size_t>(count));
    read(first, count, type_, piece.data());
    visit(piece);
  }
}

void RowDataset::each_number(const std::function<void(std::span<const double>)>& visit) const {
  if (row_size() == 0) return;
  const std::int64_t at_once = rows_at_once(sizeof(double));
  std::vector<double> values;
  std::vector<std::int8_t> bools;
  for (std::int64_t first = 0; first < rows(); first += at_once) {
    const std::int64_t count = std::min(at_once, rows() - first);
    values.resize(static_cast<std::size_t>(count * row_size()));
    if (is_bool()) {
      bools.resize(values.size());
      read(first, count, type_, bools.data());
      std::copy(bools.begin(), bools.end(), values.begin());
    } else {
      read(first, count, H5T_NATIVE_DOUBLE, values.data());
    }
    visit(values);
  }
}

std::string read_file_name(hid_t sensor_data, const std::string& key) {
  const std::string bytes = hdf5::read_bytes(sensor_data, key, kMaxNameBytes);
  std::string name(trim_row(bytes));
  if (!is_plain_name(name) || printable(name) != name)
    throw RuntimeError(fmt::format(
        "names a video '{:.100}', which is not a plain file name in its folder", printable(name)));
  return name;
}

}  // namespace mjsense::replay
