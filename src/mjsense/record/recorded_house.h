// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a house contains (see recording_folder.h), read without recording into it, and its removal.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/record/folder.h"

namespace mjsense::record {

// Names that a house uses for unpublished files.
inline constexpr const char* kStagingDir = ".recording";
inline constexpr const char* kEpisodeFile = "traj.h5";
inline constexpr const char* kDamagedDir = "damaged";
inline constexpr const char* kDescription = "recording.json";

// True if `text` describes a recording completely enough to publish it.
bool is_description(const std::string& text);
// Reads a small file of a recording; "" if it cannot be read.
std::string read_whole(const Folder& folder, const char* name);
// "episode_00000007" + suffix -> 7
std::optional<std::int64_t> episode_number(const std::string& name, std::string_view suffix);

// A published HDF5 file.
struct Published {
  int batch = 0;
  std::string recording;  // "" if it was not recorded by mjsense
  std::vector<std::int64_t> episodes;
};
// Names of the HDF5 files that are published in a house.
std::vector<std::string> published_files(const Folder& house);
// "trajectories_batch_2_of_3.h5" -> 2; 0 for other names.
int batch_in(const std::string& name);
// Throws Error if the file cannot be read.
Published read_published(const Folder& house, const std::string& name);

// Where a recording begins in a house that contains completed recordings: the number of its first
// attempt, and the number of their HDF5 files.
struct RecordingStart {
  std::int64_t attempt = 0;
  int batch = 0;
};
// The start that a recording's description states.
RecordingStart start_in(const std::string& description);
// RecordingCfg::attempts of a recording with this description.
std::vector<std::int64_t> attempts_in(const std::string& description);
// Start of a recording that continues those of this house. Throws ValueError if one of them is
// unfinished.
RecordingStart start_after(const std::filesystem::path& house);
// Start of the unfinished recording or, if there is none, of the last completed one.
RecordingStart start_of_last(const std::filesystem::path& house);

// Removes the recordings of a house and nothing else. Throws ValueError if another process records
// into it.
void remove_recordings(const std::filesystem::path& house);

// Description of the unfinished recording in the folder `staging` (kStagingDir): the text of
// recording.json. If that file is lost or no finished episode agrees with it, it is the text that
// most finished episodes carry. "" if there is no unfinished recording.
std::string unfinished_recording(const Folder& staging);
// Directories of finished, unpublished episodes, in order.
std::vector<std::filesystem::path> finished_episodes(const std::filesystem::path& house);

}  // namespace mjsense::record
