// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/files/file_size_limit.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/recording_folder.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

constexpr std::int64_t kNameBytes = 1 << 12;  // on disk, for a name with its data set and groups

// Removes what remains of a recording that never finished an episode.
void remove_remains(const fs::path& house, const record::Folder& folder,
                    std::vector<std::string>& actions) {
  const fs::path staging = house / record::kStagingDir;
  if (const std::size_t episodes = record::finished_episodes(house).size(); episodes > 0)
    throw RuntimeError(
        fmt::format("'{}' contains {}, but nothing identifies their recording; nothing was removed",
                    staging.string(), counted(episodes, "finished episode")));
  if (!folder.remove(record::kStagingDir, folder.open_dir(record::kStagingDir)))
    throw RuntimeError(fmt::format("cannot remove '{}'", staging.string()));
  actions.push_back(
      fmt::format("{}: removed the remains of '{}'", house.string(), record::kStagingDir));
}

void finish_house(const fs::path& house, std::vector<std::string>& actions) {
  const record::Folder folder = record::Folder::open(house);
  std::string fingerprint;
  {
    // A recording that is starting has not written its fingerprint yet.
    const Fd lock = record::lock_recording(folder, true);
    fingerprint = record::unfinished_recording(folder.open_dir(record::kStagingDir));
    if (fingerprint.empty()) return remove_remains(house, folder, actions);
  }
  const std::size_t waiting = record::finished_episodes(house).size();
  record::RecordingFolder store(house, fingerprint, true);
  store.publish_all();
  for (const std::string& damage : store.damage())
    actions.push_back(fmt::format("{}: {}", house.string(), damage));
  actions.push_back(fmt::format("{}: published {} and ended the recording", house.string(),
                                counted(waiting - store.damage().size(), "finished episode")));
}

// A new file with the bytes and the rights of `from`.
void copy_file(const Fd& from, const record::Folder& folder, const std::string& name) {
  const FileLimitGuard limit;
  folder.remove(name);
  struct stat about = {};
  if (fstat(from.get(), &about) != 0)
    record::throw_file("read the source of the copy", folder.display_path(name), errno);
  const Fd file(openat(folder.fd(), name.c_str(),
                       O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!file || fchmod(file.get(), about.st_mode & 0777) != 0)
    record::throw_file("write", folder.display_path(name), errno);
  std::vector<std::byte> piece(1 << 20);
  for (off_t at = 0;;) {
    const ssize_t n = pread(from.get(), piece.data(), piece.size(), at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) record::throw_file("read the source of the copy", folder.display_path(name), errno);
    if (n == 0) break;
    if (!write_all(file, std::span(piece).first(static_cast<std::size_t>(n))))
      record::throw_file("write", folder.display_path(name), errno);
    at += n;
  }
}

void add_file_name(hid_t sensor_data, const std::string& key, const std::string& name) {
  const hsize_t size = record::kFileNameBytes;
  const hdf5::Id space(H5Screate_simple(1, &size, nullptr), H5Sclose, key);
  const hdf5::Id dataset(H5Dcreate2(sensor_data, key.c_str(), H5T_STD_U8LE, space, H5P_DEFAULT,
                                    hdf5::dataset_properties(), H5P_DEFAULT),
                         H5Dclose, key);
  char bytes[record::kFileNameBytes] = {};
  name.copy(bytes, sizeof bytes);
  hdf5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes), key);
}

// Names that MolmoSpaces leaves out: the video of each camera that has parameters.
std::string missing_names(const fs::path& path, int batch, int batches) {
  nlohmann::json missing = nlohmann::json::array();
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(path);
  for (const std::string& trajectory : trajectory_names(file)) {
    const std::string params = trajectory + "/obs/sensor_param";
    if (!hdf5::exists(file, params)) continue;
    const std::int64_t number =
        hdf5::int_attribute(hdf5::open_group(file, trajectory), "episode", -1);
    for (const std::string& camera : hdf5::children(hdf5::open_group(file, params))) {
      for (const std::string& key : {camera, camera + "_depth"}) {
        const std::string context = fmt::format("{}/obs/sensor_data", trajectory);
        if (hdf5::exists(file, fmt::format("{}/{}", context, key))) continue;
        // Files that have no episode numbers name videos by their position in the file.
        const std::string name =
            number >= 0 ? record::video_file(number, key + ".mp4")
                        : fmt::format("episode_{:08d}_{}_batch_{}_of_{}.mp4",
                                      std::atoi(trajectory.c_str() + 5), key, batch, batches);
        if (is_plain_name(name) && printable(name) == name &&
            name.size() <= record::kFileNameBytes && is_plain_file(path.parent_path() / name))
          missing.push_back({context, key, name});
      }
    }
  }
  return missing.dump();
}

// "trajectories_batch_2_of_3.h5" -> {2, 3}
std::optional<std::pair<int, int>> batch_number(const fs::path& path) {
  const std::string name = path.filename().string();
  int batch = 0, batches = 0;
  if (std::sscanf(name.c_str(), "trajectories_batch_%9d_of_%9d.h5", &batch, &batches) != 2 ||
      batch < 1 || name != record::batch_file(batch - 1, batches))
    return {};
  return std::pair{batch, batches};
}

int name_videos(const fs::path& path) {
  const auto number = batch_number(path);
  if (!number) return 0;
  const Fd bytes = open_plain(path.parent_path(), path.filename().string());
  const record::Seal seal = record::check_seal(bytes.get());
  if (seal == record::Seal::kCorrupt)
    throw RuntimeError(fmt::format("'{}' is damaged: its checksum is wrong", path.string()));
  const auto missing = nlohmann::json::parse(
      hdf5::in_child(path.string(), static_cast<std::uint64_t>(size_of(bytes)),
                     [&] { return missing_names(path, number->first, number->second); }));
  if (missing.empty()) return 0;  // most files need no repair and are not opened for writing
  if (flock(bytes.get(), LOCK_EX | LOCK_NB) != 0)
    throw RuntimeError(fmt::format("another process is repairing '{}'", path.string()));
  // Works on a copy, so that a crash or a full disk leaves the file unchanged.
  const record::Folder folder = record::Folder::open(path.parent_path());
  const std::string name = path.filename(), part = name + ".part";
  struct Removed {
    const record::Folder& folder;
    const std::string& name;
    ~Removed() { folder.remove(name); }
  } const removed{folder, part};
  copy_file(bytes, folder, part);
  folder.reserve_space(part,
                       size_of(bytes) + kNameBytes * static_cast<std::int64_t>(missing.size() + 1));
  {
    const hdf5::H5Lock lock;
    hdf5::Id file = hdf5::open_file(folder.fd_path(part), true, folder.display_path(part));
    for (const auto& m : missing) {
      const std::string context = m.at(0);
      if (!hdf5::exists(file, context)) hdf5::create_group(file, context);
      add_file_name(hdf5::open_group(file, context), m.at(1), m.at(2));
    }
    file.close(fmt::format("cannot write '{}'", folder.display_path(part)));
  }
  if (seal == record::Seal::kValid) record::seal_file(folder, part);
  folder.sync(part);
  folder.rename(part, folder, name);
  folder.sync();
  return static_cast<int>(missing.size());
}

}  // namespace

// A failure is reported and does not stop the repair of the other files.
RepairResult repair(const fs::path& path) {
  RepairResult result;
  if (fs::is_regular_file(path) && !batch_number(path))
    throw ValueError(fmt::format(
        "'{}' is not named trajectories_batch_*_of_*.h5: repair accepts such files and folders",
        path.string()));
  const auto attempt = [&](const fs::path& what, auto&& action) {
    try {
      action();
    } catch (const std::runtime_error& e) {  // an mjsense::Error or a filesystem_error
      result.failures.push_back(fmt::format("{}: {}", what.string(), e.what()));
    }
  };
  if (fs::is_directory(path)) {
    for (const fs::path& house : recorded_houses(path)) {
      if (fs::exists(fs::symlink_status(house / record::kStagingDir)))
        attempt(house, [&] { finish_house(house, result.actions); });
    }
  }
  std::vector<RecordedFile> files;
  try {
    files = recorded_files(path);
  } catch (const ValueError&) {  // no recording; acceptable if repairing removed what there was
    if (result.actions.empty() && result.failures.empty()) throw;
  }
  for (const RecordedFile& file : files) {
    if (!file.published) continue;
    attempt(file.path, [&] {
      if (const int added = name_videos(file.path); added > 0)
        result.actions.push_back(
            fmt::format("{}: added {}", file.path.string(), counted(added, "video name")));
    });
  }
  return result;
}

std::string RepairResult::text() const {
  std::string out;
  for (const std::string& action : actions) out += printable(action) + "\n";
  for (const std::string& failure : failures) out += "cannot repair " + printable(failure) + "\n";
  return out.empty() ? "nothing to repair\n" : out;
}

std::string RepairResult::json() const {
  return nlohmann::json{{"actions", actions}, {"failures", failures}}.dump(
      2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace mjsense::replay
