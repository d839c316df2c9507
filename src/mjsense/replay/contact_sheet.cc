// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/files/png.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/depth_encoding.h"
#include "mjsense/record/video_file.h"
#include "mjsense/replay/bitmap_font.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"
#include "mjsense/replay/video_probe.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

constexpr int kTileHeight = 132, kGap = 4, kLine = kTextHeight + kGap, kApart = 14;
constexpr std::uint8_t kBackground = 24;
// Limits of a sheet that is still useful, whatever the file claims.
constexpr int kMaxTileWidth = 8 * kTileHeight, kMaxFrames = 10'000'000;
constexpr std::size_t kMaxStrips = 128, kMaxText = 200;

// The episode's task description and its outcome: "Pick up the red block: success".
std::string story(hid_t trajectory) {
  std::string text;
  if (hdf5::exists(trajectory, "obs_scene")) {
    const auto scene =
        nlohmann::json::parse(hdf5::read_text(trajectory, "obs_scene"), nullptr, false);
    if (scene.is_object() && scene.contains("task_description") &&
        scene["task_description"].is_string())
      text = scene["task_description"];
  }
  const std::string outcome = hdf5::text_attribute(trajectory, "outcome");
  if (!text.empty() && !outcome.empty()) text += ": ";
  return text + outcome;
}

// One camera of one episode.
struct Strip {
  std::string episode, camera;  // labels on the sheet
  fs::path video;
  int width = 0, height = 0, frames = 0;  // of the video
  bool depth16 = false;
  double unit = 0;  // m per depth value
  int tile_width() const {
    return std::clamp(kTileHeight * width / std::max(1, height), 8, kMaxTileWidth);
  }

  // Indices of the frames that `columns` tiles show, evenly spaced from first to last.
  std::vector<int> moments(int columns) const {
    std::vector<int> shown;
    for (int c = 0; c < columns; ++c) {
      const int n =
          columns == 1
              ? 0
              : static_cast<int>(static_cast<std::int64_t>(c) * (frames - 1) / (columns - 1));
      if (shown.empty() || n != shown.back()) shown.push_back(n);
    }
    return shown;
  }
};

using Json = nlohmann::json;

// Content of one file: {"episodes": 4, "strips": [[trajectory, story, key, video, encoding, unit]
// ...]}.
std::string describe(const fs::path& path, int shown) {
  Json out{{"episodes", 0}, {"strips", Json::array()}};
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(path);
  const std::vector<std::string> names = trajectory_names(file);
  out["episodes"] = names.size();
  for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), std::max(0, shown)); ++i) {
    const hdf5::Id trajectory = hdf5::open_group(file, names[i]);
    if (!hdf5::exists(trajectory, "obs/sensor_data")) continue;
    const std::string told = story(trajectory).substr(0, kMaxText);
    const hdf5::Id videos = hdf5::open_group(trajectory, "obs/sensor_data");
    for (const std::string& key : hdf5::children(videos)) {
      const hdf5::Id dataset = hdf5::open_dataset(videos, key);
      out["strips"].push_back({names[i], told, key.substr(0, kMaxText), read_file_name(videos, key),
                               hdf5::text_attribute(dataset, "encoding"),
                               hdf5::double_attribute(dataset, "metres_per_unit", 0)});
    }
  }
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

record::VideoFacts facts_of(const fs::path& folder, const std::string& video,
                            const std::string& ffmpeg) {
  const Fd file = open_plain(folder, video);
  record::VideoFacts facts = record::read_video_facts(file.get());
  if (!facts.error.empty()) {  // a format that only ffmpeg may be able to read
    const VideoProbe probe = probe_video(folder / video, false, kMaxFrames, ffmpeg);
    facts = {probe.frames, probe.width, probe.height, probe.error};
  }
  if (!facts.error.empty() || facts.frames < 1 || facts.width < 1 || facts.height < 1)
    throw RuntimeError(fmt::format("contact sheet: '{}': {}", (folder / video).string(),
                                   facts.error.empty() ? "it contains no image" : facts.error));
  return facts;
}

// Returns the strips of the first `shown` episodes and sets `episodes` to the number of all.
std::vector<Strip> find_strips(const fs::path& path, int shown, const std::string& ffmpeg,
                               int& episodes) {
  std::vector<Strip> strips;
  episodes = 0;
  for (const RecordedFile& recorded : recorded_files(path)) {
    const fs::path folder = recorded.path.parent_path();
    const auto bytes =
        static_cast<std::uint64_t>(size_of(open_plain(folder, recorded.path.filename().string())));
    const Json found =
        Json::parse(hdf5::in_child(recorded.name, bytes,
                                   [&] { return describe(recorded.path, shown - episodes); }),
                    nullptr, false);
    if (found.is_discarded())
      throw RuntimeError(recorded.name + ": the process that read it returned nothing");
    episodes += found.at("episodes").get<int>();
    for (const Json& s : found.at("strips")) {
      // each strip starts an ffmpeg process, so only the first ones are shown
      if (strips.size() == kMaxStrips) break;
      const std::string trajectory = s.at(0), told = s.at(1), key = s.at(2), video = s.at(3);
      const record::VideoFacts facts = facts_of(folder, video, ffmpeg);
      Strip strip;
      strip.video = folder / video;
      strip.depth16 = s.at(4) == "depth16";
      strip.unit = s.at(5).is_number() ? s.at(5).get<double>() : 0;
      strip.width = facts.width;
      strip.height = facts.height;
      strip.frames = static_cast<int>(std::min<std::int64_t>(facts.frames, kMaxFrames));
      strip.episode = fmt::format("{}  {}  {}", recorded.name, trajectory, told);
      strip.camera = fmt::format("{}, {}", key, counted(strip.frames, "frame"));
      strips.push_back(std::move(strip));
    }
  }
  return strips;
}

// Colour map of depth: from yellow (near) through five colours to dark blue (far). Pixels without
// depth are black.
void colour(double x, std::uint8_t* rgb) {
  constexpr int kStops[5][3] = {
      {250, 220, 90}, {240, 120, 60}, {180, 50, 110}, {80, 40, 140}, {20, 20, 60}};
  const double at = std::clamp(x, 0.0, 1.0) * 4;
  const int i = std::min(3, static_cast<int>(at));
  for (int c = 0; c < 3; ++c)
    rgb[c] = static_cast<std::uint8_t>(kStops[i][c] + (at - i) * (kStops[i + 1][c] - kStops[i][c]));
}

// Maps depth values to colours. The range of the colour map is the smallest to the largest value in
// all images; it is appended to the label.
std::vector<std::uint8_t> colour_depth(const std::vector<std::uint8_t>& raw, double unit,
                                       std::string& label) {
  std::vector<std::uint16_t> depth(raw.size() / 2);
  std::memcpy(depth.data(), raw.data(), depth.size() * 2);
  std::uint16_t near = record::kDepthFar, far = record::kDepthInvalid;
  for (const std::uint16_t d : depth) {
    if (d == record::kDepthInvalid || d == record::kDepthFar) continue;
    near = std::min(near, d);
    far = std::max(far, d);
  }
  if (near <= far && unit > 0)
    label += fmt::format(", {:.2f} m (yellow) to {:.2f} m (blue)", near * unit, far * unit);
  std::vector<std::uint8_t> rgb(depth.size() * 3);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double span = std::max(1, far - near);
    if (depth[i] != record::kDepthInvalid)
      colour(depth[i] == record::kDepthFar ? 1.0 : (depth[i] - near) / span, &rgb[3 * i]);
  }
  return rgb;
}

class Canvas {
 public:
  Canvas(int width, int height)
      : width_(width),
        height_(height),
        rgb_(static_cast<std::size_t>(width) * height * 3, kBackground) {}

  void text(int x, int y, std::string_view text) { draw_text(rgb_, width_, x, y, text); }
  void picture(int x, int y, int width, int height, const std::uint8_t* rgb) {
    for (int row = 0; row < height; ++row)
      std::memcpy(at(x, y + row), rgb + std::size_t{3} * width * row, std::size_t{3} * width);
  }
  void write(const fs::path& png) const { write_png(png, rgb_, width_, height_, 3); }

 private:
  std::uint8_t* at(int x, int y) { return &rgb_[(static_cast<std::size_t>(y) * width_ + x) * 3]; }

  int width_, height_;
  std::vector<std::uint8_t> rgb_;
};

}  // namespace

std::string contact_sheet(const fs::path& path, const fs::path& png, int episodes, int columns,
                          const std::string& ffmpeg) {
  if (episodes < 1 || columns < 1)
    throw ValueError(fmt::format("contact sheet: {} episodes, {} columns", episodes, columns));
  int all = 0;
  std::vector<Strip> strips = find_strips(path, episodes, ffmpeg, all);
  if (strips.empty())
    throw ValueError(fmt::format("contact sheet: '{}' contains no videos", path.string()));

  // The images are read first, because the label above a depth strip depends on their values.
  std::vector<std::vector<std::uint8_t>> pictures;
  std::string title = fmt::format("{} of {} episodes", std::min(episodes, all), all);
  int tile_width = 0, width = label_width(title), height = kGap + kLine;
  for (std::size_t s = 0; s < strips.size(); ++s) {
    Strip& strip = strips[s];
    const std::vector<int> moments = strip.moments(columns);
    pictures.push_back(
        grab_frames(strip.video, moments, strip.tile_width(), kTileHeight, strip.depth16, ffmpeg));
    const std::size_t bytes =
        std::size_t{strip.depth16 ? 2u : 3u} * strip.tile_width() * kTileHeight * moments.size();
    if (pictures[s].size() < bytes)
      throw RuntimeError(
          fmt::format("contact sheet: '{}': ffmpeg returned {} bytes of images, expected {}",
                      strip.video.string(), pictures[s].size(), bytes));
    if (strip.depth16) pictures[s] = colour_depth(pictures[s], strip.unit, strip.camera);
    tile_width = std::max(tile_width, strip.tile_width());
    width = std::max({width, label_width(strip.episode), label_width(strip.camera)});
    height += kLine + kTileHeight + kGap;
    if (s == 0 || strip.episode != strips[s - 1].episode) height += kApart + kLine;
  }
  width = std::max(width + kGap, columns * (tile_width + kGap)) + kGap;

  Canvas sheet(width, height);
  sheet.text(kGap, kGap, title);
  int y = kGap + kLine;
  for (std::size_t s = 0; s < strips.size(); ++s) {
    const Strip& strip = strips[s];
    if (s == 0 || strip.episode != strips[s - 1].episode) {
      sheet.text(kGap, y + kApart, strip.episode);
      y += kApart + kLine;
    }
    sheet.text(kGap, y, strip.camera);
    const int said = kGap + label_width(strip.camera) + 2 * kTextAdvance;
    y += kLine;
    const std::vector<int> moments = strip.moments(columns);
    const std::size_t bytes = std::size_t{3} * strip.tile_width() * kTileHeight;
    for (std::size_t c = 0; c < std::min(moments.size(), pictures[s].size() / bytes); ++c) {
      const int x = kGap + static_cast<int>(c) * (tile_width + kGap);
      sheet.picture(x, y, strip.tile_width(), kTileHeight, &pictures[s][c * bytes]);
      // The frame number, right-aligned above the tile if the text of the line leaves room.
      const std::string number = std::to_string(moments[c]);
      const int left = x + strip.tile_width() - label_width(number);
      if (left >= said) sheet.text(left, y - kLine, number);
    }
    y += kTileHeight + kGap;
  }
  sheet.write(png);
  return title;
}

}  // namespace mjsense::replay
