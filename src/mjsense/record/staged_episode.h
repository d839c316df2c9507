// SPDX-License-Identifier: Apache-2.0
#pragma once
// A finished episode that waits in {house}/.recording: what its folder holds, checked. It may have
// been left by a killed process, by a broken disk or by a stranger.

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/hdf5/h5.h"
#include "mjsense/record/folder.h"

namespace mjsense {

struct StagedVideo {
  std::string key;   // dataset in obs/sensor_data
  std::string name;  // of the file, in the episode's folder
  std::string crc;   // "" if not stated
};

struct StagedEpisode {
  std::string recording;  // what recording it belongs to: JSON text
  std::int64_t steps = 0;
  std::vector<StagedVideo> videos;
};

// What traj.h5 of this folder says, read in a process of its own. Throws RuntimeError that says
// what is wrong with it.
StagedEpisode read_staged(const Folder& folder);

// Throws RuntimeError unless every video is there, whole, with a picture for each step.
void check_staged_videos(const Folder& folder, const StagedEpisode& episode);
// Of one of them.
void check_staged_video(const Folder& folder, const StagedVideo& video, std::int64_t steps);

// The names in traj/obs/sensor_data, which are plain. Throws RuntimeError if one is not.
std::vector<StagedVideo> staged_videos(hid_t trajectory);

}  // namespace mjsense
