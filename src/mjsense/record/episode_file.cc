// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/episode_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/files/deflate.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"
#include "mjsense/hdf5/chunk_checks.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/depth_encoding.h"
#include "mjsense/record/molmospaces.h"

namespace mjsense::record {
namespace {

constexpr std::string_view kVideos = "obs/sensor_data/";  // names of videos

// Every dataset has these attributes; "" means that it has no unit or no frame.
void describe(hid_t dataset, std::string_view unit, std::string_view frame,
              std::string_view description) {
  hdf5::set_attribute(dataset, "unit", unit);
  hdf5::set_attribute(dataset, "frame", frame);
  hdf5::set_attribute(dataset, "description", description);
}

void describe(hid_t dataset, std::string_view sensor, std::string_view kind,
              const SensorSpec& spec) {
  describe(dataset, spec.unit, spec.frame, spec.description);
  hdf5::set_attribute(dataset, "spec", spec_json(sensor, kind, spec));
}

void describe_video(hid_t dataset, const RecordingCfg& cfg, const VideoStream& video) {
  describe(dataset, video.sensor->name(), video.sensor->kind(), video.field->spec);
  hdf5::set_attribute(dataset, "width", std::int64_t{video.width});
  hdf5::set_attribute(dataset, "height", std::int64_t{video.height});
  hdf5::set_attribute(dataset, "fps", cfg.fps.str());
  switch (video.kind) {
    case VideoKind::kRgb:
      hdf5::set_attribute(dataset, "encoding", "rgb");
      hdf5::set_attribute(dataset, "codec", video.codec());
      break;
    case VideoKind::kDepth16:
      hdf5::set_attribute(dataset, "encoding", "depth16");
      hdf5::set_attribute(dataset, "codec", video.codec());
      hdf5::set_attribute(dataset, "metres_per_unit", cfg.video.depth_unit);
      hdf5::set_attribute(dataset, "invalid_value", std::int64_t{kDepthInvalid});
      hdf5::set_attribute(dataset, "far_value", std::int64_t{kDepthFar});
      break;
    case VideoKind::kDepthRedGreen:
      hdf5::set_attribute(dataset, "encoding", "molmospaces_red_green");
      hdf5::set_attribute(dataset, "codec", video.codec());
      break;
  }
}

void add_file_name(hid_t trajectory, const RecordingCfg& cfg, const VideoStream& video) {
  const hsize_t size = kFileNameBytes;
  const hdf5::Id space(H5Screate_simple(1, &size, nullptr), H5Sclose, "HDF5 space");
  const std::string path = std::string(kVideos) + video.key;
  const hdf5::Id dataset(
      H5Dcreate2(trajectory, path.c_str(), H5T_STD_U8LE, space, hdf5::link_properties(),
                 hdf5::dataset_properties(), H5P_DEFAULT),
      H5Dclose, path);
  char name[kFileNameBytes] = {};
  const std::string file = video.stem + video.extension;
  std::memcpy(name, file.data(), std::min(file.size(), kFileNameBytes));
  hdf5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, name), path);
  describe_video(dataset, cfg, video);
}

}  // namespace

std::string_view own_path(int stream) {
  constexpr std::string_view kPlaces[kOwnStreams] = {"rewards", "success", "fail", "terminated",
                                                     "truncated"};
  return kPlaces[stream];
}

DType own_dtype(int stream) { return stream == kRewards ? DType::kFloat32 : DType::kBool; }

std::string_view own_description(int stream) {
  constexpr std::string_view kDescriptions[kOwnStreams] = {
      "Reward of the step that led to the observation; that of the first observation is of no "
      "step.",
      "Whether the observation is a success. It may become false again.",
      "The opposite of success.",
      "Whether the task or the policy ends the episode at this observation.",
      "Whether the episode ends at this observation because its horizon is reached."};
  return kDescriptions[stream];
}

EpisodeFile::EpisodeFile(std::shared_ptr<const Folder> folder, const std::string& name,
                         const RecordingCfg& cfg, const RecordingPlan& plan,
                         const EpisodeMeta& meta)
    : folder_(std::move(folder)), name_(name), gzip_(cfg.gzip), plan_(plan) {
  const hdf5::H5Lock lock;
  file_ = hdf5::create_file(folder_->fd_path(name), folder_->display_path(name));
  hdf5::set_attribute(file_, "format", "mjsense 1");
  hdf5::set_attribute(file_, "recording", plan.fingerprint);
  trajectory_ = hdf5::create_group(file_, "traj_0");
  hdf5::set_attribute(trajectory_, "episode", meta.episode);
  hdf5::set_attribute(trajectory_, "seed", meta.seed);
  for (const char* group : standard_groups()) hdf5::create_group(trajectory_, group);
  datasets_.reserve(plan.arrays.size() + kOwnStreams);
  for (const ArrayStream& stream : plan.arrays) {
    add_dataset(stream.path, stream.spec.dtype, stream.spec.shape, stream.chunk_rows);
    describe(datasets_.back().id, stream.sensor->name(), stream.kind(), stream.spec);
    if (stream.spec.is_dict) hdf5::set_attribute(datasets_.back().id, "encoding", "json");
  }
  for (int i = 0; i < kOwnStreams; ++i) {
    add_dataset(own_path(i), own_dtype(i), Shape{}, chunk_rows(dtype_size(own_dtype(i))));
    describe(datasets_.back().id, "", "", own_description(i));
  }
  for (const VideoStream& video : plan.videos) add_file_name(trajectory_, cfg, video);
}

EpisodeFile::~EpisodeFile() {
  const hdf5::H5Lock lock;
  datasets_.clear();
  trajectory_.reset();
  file_.reset();
}

void EpisodeFile::add_dataset(std::string_view path, DType dtype, const Shape& row,
                              std::int64_t chunk_rows) {
  Dataset dataset;
  hsize_t chunk[Shape::kMaxRank + 1] = {static_cast<hsize_t>(chunk_rows)};
  hsize_t maximum[Shape::kMaxRank + 1] = {H5S_UNLIMITED};
  dataset.rank = row.rank() + 1;
  dataset.row_bytes = static_cast<std::size_t>(row.size()) * dtype_size(dtype);
  for (int i = 0; i < row.rank(); ++i) {
    // A row may have no elements, but HDF5 requires chunk dimensions of at least 1.
    const auto size = static_cast<hsize_t>(row[i]);
    dataset.dims[i + 1] = size;
    chunk[i + 1] = std::max<hsize_t>(1, size);
    maximum[i + 1] = size == 0 ? H5S_UNLIMITED : size;
  }

  const std::string name(path);
  const hdf5::Id space(H5Screate_simple(dataset.rank, dataset.dims, maximum), H5Sclose, name);
  const hdf5::Id properties = hdf5::dataset_properties();
  hdf5::check(H5Pset_chunk(properties, dataset.rank, chunk), name);
  if (gzip_ > 0) hdf5::check(H5Pset_deflate(properties, static_cast<unsigned>(gzip_)), name);

  const auto slash = name.rfind('/');
  if (slash != std::string::npos) hdf5::create_group(trajectory_, name.substr(0, slash));
  dataset.id = hdf5::Id(H5Dcreate2(trajectory_, name.c_str(), hdf5::memory_type(dtype), space,
                                   hdf5::link_properties(), properties, H5P_DEFAULT),
                        H5Dclose, name);
  dataset.crc = hdf5::create_text_attribute(dataset.id, kChecksumAttribute);
  datasets_.push_back(std::move(dataset));
}

std::span<const std::uint8_t> EpisodeFile::texts_of(const ArrayStream& stream, std::int64_t rows,
                                                    std::span<const std::uint8_t> kept) {
  const std::size_t kept_bytes = stream.kept_bytes(), text_bytes = stream.row_bytes();
  texts_.assign(stream.chunk_rows * text_bytes, 0);
  for (std::int64_t i = 0; i < rows; ++i)
    stream.text->write(kept.data() + i * kept_bytes, {&texts_[i * text_bytes], text_bytes});
  return texts_;
}

void EpisodeFile::write_chunk(int stream, std::int64_t rows, std::span<const std::uint8_t> chunk) {
  const auto index = static_cast<std::size_t>(stream);
  if (index < plan_.arrays.size() && plan_.arrays[index].text)
    chunk = texts_of(plan_.arrays[index], rows, chunk);
  std::span<const std::uint8_t> bytes = chunk;
  // Without the lock of the HDF5 library, because compression takes most of the time.
  if (gzip_ > 0 && !chunk.empty()) bytes = deflated(chunk, gzip_, DeflateFormat::kZlib);
  // Computed here because the compressor has just loaded the chunk into this core's cache.
  if (!chunk.empty())
    datasets_[index].sum.add(chunk.data(),
                             static_cast<std::size_t>(rows) * datasets_[index].row_bytes);
  const hdf5::H5Lock lock;
  Dataset& dataset = datasets_[stream];
  hsize_t offset[Shape::kMaxRank + 1] = {dataset.dims[0]};
  dataset.dims[0] += static_cast<hsize_t>(rows);
  const std::string what = fmt::format("cannot write '{}'", folder_->display_path(name_));
  hdf5::check(H5Dset_extent(dataset.id, dataset.dims), what);
  if (chunk.empty()) return;
  hdf5::check(H5Dwrite_chunk(dataset.id, H5P_DEFAULT, 0, offset, bytes.size(), bytes.data()), what);
}

void EpisodeFile::write_scene(std::string_view obs_scene, std::string_view outcome,
                              std::int64_t steps) {
  Checksum sum;
  sum.add(obs_scene.data(), obs_scene.size());
  const hdf5::H5Lock lock;
  const hdf5::Id dataset = hdf5::write_text(trajectory_, "obs_scene", obs_scene);
  describe(dataset, "", "", "The episode's task, instruction, objects and cameras as JSON text.");
  hdf5::set_attribute(dataset, kChecksumAttribute, sum.text());
  hdf5::set_attribute(trajectory_, "outcome", outcome);
  hdf5::set_attribute(trajectory_, "steps", steps);
}

void EpisodeFile::write_array(const EpisodeArray& array) {
  Checksum sum;
  sum.add(array.values.data(), array.values.size());
  const std::string path = fmt::format("{}{}", kReplayGroup, array.path);
  const hdf5::H5Lock lock;
  std::vector<hsize_t> dims(array.shape.dims().begin(), array.shape.dims().end());
  const hdf5::Id space(H5Screate_simple(array.shape.rank(), dims.data(), nullptr), H5Sclose, path);
  const hdf5::Id properties = hdf5::dataset_properties();
  if (gzip_ > 0) {
    hdf5::check(H5Pset_chunk(properties, array.shape.rank(), dims.data()), path);
    hdf5::check(H5Pset_deflate(properties, static_cast<unsigned>(gzip_)), path);
  }
  const hdf5::Id dataset(H5Dcreate2(trajectory_, path.c_str(), hdf5::memory_type(array.dtype),
                                    space, hdf5::link_properties(), properties, H5P_DEFAULT),
                         H5Dclose, path);
  hdf5::check(H5Dwrite(dataset, hdf5::memory_type(array.dtype), H5S_ALL, H5S_ALL, H5P_DEFAULT,
                       array.values.data()),
              path);
  describe(dataset, array.unit, array.frame, array.description);
  hdf5::set_attribute(dataset, kChecksumAttribute, sum.text());
}

void EpisodeFile::write_histogram(const VideoStream& video, const ImageHistogram& histogram) {
  const hsize_t dims[] = {ImageHistogram::kChannels, ImageHistogram::kLevels};
  const hdf5::H5Lock lock;
  const hdf5::Id dataset = hdf5::open_dataset(trajectory_, std::string(kVideos) + video.key);
  hdf5::set_attribute(dataset, "histogram", histogram.counts(), dims);
}

void EpisodeFile::carry_over(const EpisodeSource& source) {
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(source.file);
  const hdf5::Id from = hdf5::open_group(file, source.trajectory);
  const auto carry = [&](const std::string& path) {
    const auto is_inside = [&](std::string_view group) {
      return path.starts_with(group) && (path.size() == group.size() || path[group.size()] == '/');
    };
    if (path == "obs_scene" || std::ranges::any_of(source.skip, is_inside)) return;
    if (hdf5::exists(trajectory_, path)) return;
    const hdf5::Id dataset = hdf5::open_dataset(from, path);
    // The HDF5 library copies chunks that cannot be unpacked, and frees them twice.
    hdf5::check_storage(dataset, path);
    hdf5::check_chunks(dataset, path);
    hdf5::check(H5Ocopy(from, path.c_str(), trajectory_, path.c_str(), H5P_DEFAULT,
                        hdf5::link_properties()),
                fmt::format("cannot copy '{}' of '{}'", path, source.file.string()));
    if (path.starts_with(kVideos)) carry_video(source.file.parent_path(), path);
  };
  try {
    hdf5::each_dataset(from, carry);
  } catch (const Error& e) {
    throw RuntimeError(
        fmt::format("'{}' {}: {}", source.file.string(), source.trajectory, e.what()));
  }
}

void EpisodeFile::carry_video(const std::filesystem::path& folder, const std::string& path) {
  std::string name = hdf5::read_bytes(trajectory_, path, kFileNameBytes);
  name.resize(name.find_last_not_of('\0') + 1);
  const Fd file = open_plain(folder, name);
  std::string bytes(static_cast<std::size_t>(size_of(file)), '\0');
  std::ifstream(os::path_of(file.get()), std::ios::binary)
      .read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  Checksum sum;
  sum.add(bytes.data(), bytes.size());
  const hdf5::Id dataset = hdf5::open_dataset(trajectory_, path);
  const std::string stated = hdf5::text_attribute(dataset, kChecksumAttribute);
  if (!stated.empty() && stated != sum.text())
    throw RuntimeError(
        fmt::format("'{}' is damaged: its checksum is wrong", (folder / name).string()));
  const std::string copy =
      path.substr(kVideos.size()) + std::filesystem::path(name).extension().string();
  folder_->write(copy, bytes);
  char padded[kFileNameBytes] = {};
  std::memcpy(padded, copy.data(), std::min(copy.size(), kFileNameBytes));
  hdf5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, padded), path);
}

void EpisodeFile::finish(std::span<const VideoSum> videos) {
  const hdf5::H5Lock lock;
  for (const Dataset& dataset : datasets_)
    hdf5::write_text_attribute(dataset.crc, dataset.sum.text());
  for (std::size_t v = 0; v < videos.size(); ++v) {
    const hdf5::Id dataset =
        hdf5::open_dataset(trajectory_, std::string(kVideos) + plan_.videos[v].key);
    hdf5::set_attribute(dataset, kChecksumAttribute, videos[v].crc);
    hdf5::set_attribute(dataset, kBytesAttribute, videos[v].bytes);
  }
  datasets_.clear();
  trajectory_.reset();
  file_.close(fmt::format("cannot write '{}'", folder_->display_path(name_)));
  seal_file(*folder_, name_);
}

}  // namespace mjsense::record
