// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/staged_episode.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/hdf5/chunk_checks.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/record/video_file.h"

namespace mjsense::record {
namespace {

using Json = nlohmann::json;

// Copies in memory only: data that the library cannot copy must not reach an output file.
void try_copy(hid_t file) {
  const hdf5::Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 property list");
  hdf5::check(H5Pset_fapl_core(access, std::size_t{1} << 20, false), "HDF5 memory file");
  const hdf5::Id copy(H5Fcreate("copy", H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose,
                      "HDF5 memory file");
  hdf5::check(H5Ocopy(file, "traj_0", copy, "traj_0", H5P_DEFAULT, H5P_DEFAULT),
              "cannot be copied");
}

std::string describe(const Fd& traj) {
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(os::path_of(traj.get()), false, kEpisodeFile);
  const hdf5::Id trajectory = hdf5::open_group(file, "traj_0");
  hdf5::each_dataset(trajectory, [&](const std::string& name) {
    const hdf5::Id dataset = hdf5::open_dataset(trajectory, name);
    hdf5::check_storage(dataset, name);
    // The HDF5 library copies chunks that cannot be unpacked, and frees them twice.
    hdf5::check_chunks(dataset, name);
  });
  try_copy(file);
  const std::vector<hsize_t> rows = hdf5::dims(hdf5::open_dataset(trajectory, "success"));
  Json out{{"recording", hdf5::text_attribute(file, "recording")},
           {"steps", rows.empty() ? 0 : rows[0]},
           {"videos", Json::array()}};
  for (const StagedVideo& video : staged_videos(trajectory))
    out["videos"].push_back({video.key, video.name, video.crc});
  return out.dump();
}

}  // namespace

std::vector<StagedVideo> staged_videos(hid_t trajectory) {
  std::vector<StagedVideo> videos;
  const hdf5::Id names = hdf5::open_group(trajectory, "obs/sensor_data");
  for (const std::string& key : hdf5::children(names)) {
    std::string name = hdf5::read_bytes(names, key, kFileNameBytes);
    name.resize(name.find_last_not_of('\0') + 1);
    if (!is_plain_name(name))
      throw RuntimeError(fmt::format(
          "names a video '{}', which is not a plain file name in its folder", printable(name)));
    const hdf5::Id dataset = hdf5::open_dataset(names, key);
    videos.push_back({key, name, hdf5::text_attribute(dataset, kChecksumAttribute)});
  }
  return videos;
}

StagedEpisode read_staged(const Folder& folder) {
  const Fd file = open_plain(folder.fd(), kEpisodeFile);
  if (check_seal(file.get()) == Seal::kCorrupt)
    throw RuntimeError(fmt::format("'{}' is damaged: its checksum is wrong", kEpisodeFile));
  StagedEpisode episode;
  try {
    const Json found = Json::parse(hdf5::in_child(
        kEpisodeFile, static_cast<std::uint64_t>(size_of(file)), [&] { return describe(file); }, 0,
        file.get()));
    episode.recording = found.at("recording");
    episode.steps = found.at("steps");
    for (const Json& v : found.at("videos")) episode.videos.push_back({v.at(0), v.at(1), v.at(2)});
  } catch (const Json::exception&) {
    throw RuntimeError(
        fmt::format("'{}' is damaged: the process that read it returned nothing", kEpisodeFile));
  }
  return episode;
}

void check_staged_video(const Folder& folder, const StagedVideo& video, std::int64_t steps) {
  const Fd file = open_plain(folder.fd(), video.name);
  const VideoFacts facts = read_video_facts(file.get());
  if (!facts.error.empty())
    throw RuntimeError(fmt::format("'{}' is not a complete video: {}", video.name, facts.error));
  if (facts.frames != steps)
    throw RuntimeError(
        fmt::format("'{}' has {}, expected {}", video.name, counted(facts.frames, "frame"), steps));
  if (!video.crc.empty() && checksum_of(file.get()) != video.crc)
    throw RuntimeError(fmt::format("'{}' is damaged: its checksum is wrong", video.name));
}

void check_staged_videos(const Folder& folder, const StagedEpisode& episode) {
  for (const StagedVideo& video : episode.videos) check_staged_video(folder, video, episode.steps);
}

}  // namespace mjsense::record
