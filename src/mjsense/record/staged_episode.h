// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads and checks a finished episode in {house}/.recording before it is published. Its files are
// not trusted: a killed process, a faulty disk or another program may have left them.

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/hdf5/h5.h"
#include "mjsense/record/folder.h"

namespace mjsense::record {

struct StagedVideo {
  std::string key;   // dataset in obs/sensor_data
  std::string name;  // file name in the episode's folder
  std::string crc;   // "" if the file does not state it
};

struct StagedEpisode {
  std::string recording;  // description of the recording it belongs to, JSON text
  std::int64_t steps = 0;
  std::vector<StagedVideo> videos;
};

// Reads traj.h5 of this folder in a child process. Throws RuntimeError with a description of the
// fault.
StagedEpisode read_staged(const Folder& folder);

// Throws RuntimeError unless every video is present and complete and has one frame per step.
void check_staged_videos(const Folder& folder, const StagedEpisode& episode);
// The same for one video.
void check_staged_video(const Folder& folder, const StagedVideo& video, std::int64_t steps);

// Videos named in traj/obs/sensor_data. Throws RuntimeError unless all are plain file names.
std::vector<StagedVideo> staged_videos(hid_t trajectory);

}  // namespace mjsense::record
