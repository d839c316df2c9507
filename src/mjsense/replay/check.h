// SPDX-License-Identifier: Apache-2.0
#pragma once
// Looking at recordings: verify, repair, inspect, contact sheet. `path` is an output directory, a
// house directory or one .h5 file. Files of MolmoSpaces are understood too. Each result is data;
// text() is what a person reads, json() what a script does.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace mjsense {

struct Finding {
  bool error = true;  // false: worth knowing, not wrong
  std::string place;  // "house_0/trajectories_batch_1_of_2.h5 traj_3/obs/agent/qpos"
  std::string text;
};

struct VerifyResult {
  int files = 0, episodes = 0, steps = 0, videos = 0;
  int unpublished = 0;  // finished episodes that wait for their batch
  std::vector<Finding> findings;
  bool ok() const;
  std::string text() const;
  std::string json() const;
};

struct VerifyOptions {
  bool decode = false;  // decode every frame instead of counting packets
  std::string ffmpeg;   // as in VideoCfg
};

// Structure, names and types; equal lengths; every JSON row parses; every video exists and has T
// frames of the stated size; checksums of files, datasets and videos. Always ends with findings: a
// file is read in a process of its own, within limits that its size decides.
[[nodiscard]] VerifyResult verify(const std::filesystem::path& path,
                                  const VerifyOptions& options = {});

struct RepairResult {
  std::vector<std::string> actions;   // what was done, one sentence each
  std::vector<std::string> failures;  // what could not be, and why
  std::string text() const;
  std::string json() const;
};

// Ends interrupted recordings: publishes the finished episodes of {house}/.recording, removes
// unfinished ones, sets damaged ones aside in {house}/damaged, and writes names of videos into files whose obs/sensor_data lacks them. A
// recording that shall go on is resumed, not repaired.
RepairResult repair(const std::filesystem::path& path);

struct StreamStats {
  std::string name;  // "obs/agent/qpos/arm": dict rows are split by key
  std::string dtype, shape, unit, frame, description;
  std::int64_t count = 0, nan = 0, infinite = 0;  // the others are counted apart
  double mean = 0, std = 0, min = 0, max = 0;
};

struct InspectResult {
  struct File {
    std::string path;
    std::int64_t bytes = 0;
    int episodes = 0, successes = 0, steps = 0;
    std::map<std::string, std::vector<std::string>> outcomes;  // how episodes ended -> their names
  };
  std::vector<File> files;
  std::vector<std::string> videos;
  std::vector<StreamStats> streams;  // of all episodes together
  std::string settings;              // JSON text of the recording, "" if unknown
  std::string text() const;
  std::string json() const;
};

[[nodiscard]] InspectResult inspect(const std::filesystem::path& path);

// A PNG with one row of pictures per camera and episode (the first `episodes`), `columns` moments
// from first to last frame. Returns how many episodes it shows, as it says in its first line: "4 of
// 8 episodes".
std::string contact_sheet(const std::filesystem::path& path, const std::filesystem::path& png,
                          int episodes = 4, int columns = 8, const std::string& ffmpeg = "");

}  // namespace mjsense
