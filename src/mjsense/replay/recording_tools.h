// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tools for recordings: verify, repair, inspect, contact sheet. `path` is an output directory, a
// house directory or one .h5 file; files of MolmoSpaces are supported too. Each result is data,
// with text() for people and json() for scripts.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace mjsense::replay {

struct Finding {
  bool error = true;    // false: a note, not a fault
  std::string context;  // "house_0/trajectories_batch_1_of_2.h5 traj_3/obs/agent/qpos"
  std::string text;
};

struct VerifyResult {
  int files = 0, episodes = 0, steps = 0, videos = 0;
  int unpublished = 0;  // finished episodes that are not yet in a published batch
  std::vector<Finding> findings;
  bool ok() const;
  std::string text() const;
  std::string json() const;
};

struct VerifyOptions {
  bool decode = false;  // decode every frame instead of counting packets
  std::string ffmpeg;   // as in VideoCfg
  // Called after each file and video: "12 of 40 files". Calls do not overlap.
  std::function<void(const std::string& text)> progress;
};

// Checks structure, names and types, equal lengths, JSON rows, NaN in streams whose description does
// not mention NaN, the number and size of the frames of
// every video, and the checksums of files, data sets and videos. Always returns: each file is read
// in a separate process, with limits that depend on its size.
[[nodiscard]] VerifyResult verify(const std::filesystem::path& path,
                                  const VerifyOptions& options = {});

struct RepairResult {
  std::vector<std::string> actions;   // what was done, one sentence each
  std::vector<std::string> failures;  // what could not be done, and why
  std::string text() const;
  std::string json() const;
};

// Ends interrupted recordings: publishes the finished episodes of {house}/.recording, removes
// unfinished ones, moves damaged ones to {house}/damaged, and writes the names of videos into files
// whose obs/sensor_data lacks them. To continue a recording, resume it instead.
RepairResult repair(const std::filesystem::path& path);

struct StreamStats {
  std::string name;  // "obs/agent/qpos/arm": dict rows are split by key
  std::string dtype, shape, unit, frame, description;
  std::int64_t count = 0, nan = 0, infinite = 0;  // NaN and infinite values are not in `count`
  double mean = 0, std = 0, min = 0, max = 0;
};

struct InspectResult {
  struct File {
    std::string path;
    std::int64_t bytes = 0;
    int episodes = 0, successes = 0, steps = 0;
    std::map<std::string, std::vector<std::string>> outcomes;  // outcome -> names of its episodes
  };
  std::vector<File> files;
  std::vector<std::string> videos;
  std::vector<StreamStats> streams;     // over all episodes
  std::string settings;                 // JSON text of the recording, "" if unknown
  std::vector<std::string> unfinished;  // houses whose recording has not ended
  std::string text() const;
  std::string json() const;
};

[[nodiscard]] InspectResult inspect(const std::filesystem::path& path);

// Writes a PNG with one row of images per camera and episode (the first `episodes` episodes); the
// `columns` frames are evenly spaced from first to last. Returns how many episodes it shows, which
// is also its first line: "4 of 8 episodes".
std::string contact_sheet(const std::filesystem::path& path, const std::filesystem::path& png,
                          int episodes = 4, int columns = 8, const std::string& ffmpeg = "");

}  // namespace mjsense::replay
