// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/record/house.h"
#include "mjsense/record/layout.h"
#include "mjsense/replay/check.h"
#include "mjsense/replay/trajectory.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

void finish_house(const fs::path& house, std::vector<std::string>& actions) {
  const std::string fingerprint = unfinished_recording(house);
  if (fingerprint.empty()) {
    fs::remove_all(house / kStagingDir);
    actions.push_back(fmt::format("{}: removed the remains of '{}'", house.string(), kStagingDir));
    return;
  }
  const std::size_t waiting = finished_episodes(house).size();
  House store(house, fingerprint, true);
  store.publish_all();
  actions.push_back(fmt::format("{}: published {} finished episodes and ended the recording",
                                house.string(), waiting));
}

void add_file_name(hid_t sensor_data, const std::string& key, const std::string& name) {
  const hsize_t size = kFileNameBytes;
  const h5::Id space(H5Screate_simple(1, &size, nullptr), H5Sclose, key);
  const h5::Id dataset(H5Dcreate2(sensor_data, key.c_str(), H5T_STD_U8LE, space, H5P_DEFAULT,
                                  h5::dataset_properties(), H5P_DEFAULT),
                       H5Dclose, key);
  char bytes[kFileNameBytes] = {};
  std::memcpy(bytes, name.data(), std::min(name.size(), kFileNameBytes));
  h5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes), key);
}

// What MolmoSpaces leaves out: the names of the videos of each camera that has parameters.
int name_videos(const fs::path& path) {
  int batch = 0, batches = 0, added = 0;
  if (std::sscanf(path.filename().c_str(), "trajectories_batch_%d_of_%d.h5", &batch, &batches) != 2)
    return 0;
  const auto each_missing = [&](hid_t file, auto&& found) {
    for (const std::string& trajectory : trajectory_names(file)) {
      const std::string params = trajectory + "/obs/sensor_param";
      if (!h5::exists(file, params)) continue;
      const h5::Id group(H5Gopen2(file, params.c_str(), H5P_DEFAULT), H5Gclose, params);
      for (const std::string& camera : h5::children(group)) {
        for (const std::string& key : {camera, camera + "_depth"}) {
          const std::string name =
              video_file(key, ".mp4", std::atoi(trajectory.c_str() + 5), batch - 1, batches);
          const std::string place = trajectory + "/obs/sensor_data";
          if (!h5::exists(file, place + "/" + key) && fs::exists(path.parent_path() / name))
            found(place, key, name);
        }
      }
    }
  };
  const h5::H5Lock lock;
  {
    const h5::Id file =
        h5::open_file(path);  // most files need nothing: they are not opened for writing
    each_missing(file, [&](auto&&...) { ++added; });
  }
  if (added == 0) return 0;
  h5::Id file = h5::open_file(path, true);
  each_missing(file,
               [&](const std::string& place, const std::string& key, const std::string& name) {
                 add_file_name(h5::create_group(file, place), key, name);
               });
  file.close(fmt::format("cannot write '{}'", path.string()));
  return added;
}

}  // namespace

RepairResult repair(const fs::path& path) {
  RepairResult result;
  if (fs::is_directory(path)) {
    for (const fs::path& house : recorded_houses(path)) {
      if (fs::exists(house / kStagingDir)) finish_house(house, result.actions);
    }
  }
  for (const RecordedFile& file : recorded_files(path)) {
    const int added = file.published ? name_videos(file.path) : 0;
    if (added > 0)
      result.actions.push_back(
          fmt::format("{}: added {} names of videos", file.path.string(), added));
  }
  return result;
}

std::string RepairResult::text() const {
  std::string out;
  for (const std::string& action : actions) out += action + "\n";
  return out.empty() ? "nothing to repair\n" : out;
}

std::string RepairResult::json() const { return nlohmann::json{{"actions", actions}}.dump(2); }

}  // namespace mjsense
