// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/png.h"
#include "mjsense/record/depth.h"
#include "mjsense/replay/check.h"
#include "mjsense/replay/small_text.h"
#include "mjsense/replay/trajectory.h"
#include "mjsense/replay/video_probe.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

constexpr int kTileHeight = 132, kGap = 4, kLabelHeight = 18;

struct Strip {
  std::string label;
  fs::path video;
  int width = 0, height = 0, frames = 0;  // of the video
  bool depth16 = false;
  int tile_width() const { return std::max(8, kTileHeight * width / std::max(1, height)); }
};

// Those of the first `shown` episodes, of which there are `episodes`.
std::vector<Strip> find_strips(const fs::path& path, int shown, const std::string& ffmpeg,
                               int& episodes) {
  std::vector<Strip> strips;
  episodes = 0;
  for (const RecordedFile& recorded : recorded_files(path)) {
    const h5::H5Lock lock;
    const h5::Id file = h5::open_file(recorded.path);
    for (const std::string& name : trajectory_names(file)) {
      if (++episodes > shown) continue;
      const h5::Id trajectory(H5Gopen2(file, name.c_str(), H5P_DEFAULT), H5Gclose, name);
      if (!h5::exists(trajectory, "obs/sensor_data")) continue;
      const h5::Id videos(H5Gopen2(trajectory, "obs/sensor_data", H5P_DEFAULT), H5Gclose, name);
      for (const std::string& key : h5::children(videos)) {
        const h5::Id dataset(H5Dopen2(videos, key.c_str(), H5P_DEFAULT), H5Dclose, key);
        Strip strip;
        strip.video = recorded.path.parent_path() / read_file_name(videos, key);
        strip.depth16 = h5::text_attribute(dataset, "encoding") == "depth16";
        const VideoProbe probe = probe_video(strip.video, false, ffmpeg);
        if (!probe.error.empty())
          throw RuntimeError(
              fmt::format("contact sheet: '{}': {}", strip.video.string(), probe.error));
        strip.width = probe.width;
        strip.height = probe.height;
        strip.frames = probe.frames;
        strip.label =
            fmt::format("{} {}  {}  {} frames  {}", recorded.path.parent_path().filename().string(),
                        name, key, strip.frames, h5::text_attribute(trajectory, "outcome"));
        strips.push_back(std::move(strip));
      }
    }
  }
  return strips;
}

// Near is warm, far is cold, none is black: a short walk through five colours.
void colour(double x, std::uint8_t* rgb) {
  constexpr int kStops[5][3] = {
      {250, 220, 90}, {240, 120, 60}, {180, 50, 110}, {80, 40, 140}, {20, 20, 60}};
  const double at = std::clamp(x, 0.0, 1.0) * 4;
  const int i = std::min(3, static_cast<int>(at));
  for (int c = 0; c < 3; ++c)
    rgb[c] = static_cast<std::uint8_t>(kStops[i][c] + (at - i) * (kStops[i + 1][c] - kStops[i][c]));
}

std::vector<std::uint8_t> colour_depth(const std::vector<std::uint8_t>& raw) {
  std::vector<std::uint16_t> depth(raw.size() / 2);
  std::memcpy(depth.data(), raw.data(), depth.size() * 2);
  std::uint16_t near = kDepthFar, far = kDepthInvalid;
  for (const std::uint16_t d : depth) {
    if (d == kDepthInvalid || d == kDepthFar) continue;
    near = std::min(near, d);
    far = std::max(far, d);
  }
  std::vector<std::uint8_t> rgb(depth.size() * 3);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double range = std::max(1, far - near);
    if (depth[i] != kDepthInvalid)
      colour(depth[i] == kDepthFar ? 1.0 : (depth[i] - near) / range, &rgb[3 * i]);
  }
  return rgb;
}

}  // namespace

std::string contact_sheet(const fs::path& path, const fs::path& png, int episodes, int columns,
                          const std::string& ffmpeg) {
  if (episodes < 1 || columns < 1)
    throw ValueError(fmt::format("contact sheet: {} episodes, {} columns", episodes, columns));
  int all = 0;
  const std::vector<Strip> strips = find_strips(path, episodes, ffmpeg, all);
  if (strips.empty())
    throw ValueError(fmt::format("contact sheet: '{}' holds no videos", path.string()));

  int tile_width = 0;
  for (const Strip& s : strips) tile_width = std::max(tile_width, s.tile_width());
  const int row_height = kLabelHeight + kTileHeight + kGap;
  const int width = kGap + columns * (tile_width + kGap),
            height = kLabelHeight + static_cast<int>(strips.size()) * row_height;
  std::vector<std::uint8_t> sheet(static_cast<std::size_t>(width) * height * 3, 24);
  const std::string title = fmt::format("{} of {} episodes", std::min(episodes, all), all);
  draw_text(sheet, width, kGap, kGap, title);
  for (std::size_t s = 0; s < strips.size(); ++s) {
    const Strip& strip = strips[s];
    const int top = kLabelHeight + static_cast<int>(s) * row_height;
    draw_text(sheet, width, kGap, top + 3, strip.label);
    std::vector<int> frames;  // first to last, evenly
    for (int c = 0; c < columns; ++c) {
      const int n =
          columns == 1
              ? 0
              : static_cast<int>(static_cast<std::int64_t>(c) * (strip.frames - 1) / (columns - 1));
      if (frames.empty() || n != frames.back()) frames.push_back(n);
    }
    std::vector<std::uint8_t> pixels =
        grab_frames(strip.video, frames, strip.tile_width(), kTileHeight, strip.depth16, ffmpeg);
    if (strip.depth16) pixels = colour_depth(pixels);
    const std::size_t line = static_cast<std::size_t>(strip.tile_width()) * 3,
                      tile = line * kTileHeight;
    for (std::size_t c = 0; c < std::min(frames.size(), pixels.size() / tile); ++c) {
      const int left = kGap + static_cast<int>(c) * (tile_width + kGap);
      for (int y = 0; y < kTileHeight; ++y) {
        const std::size_t to =
            (static_cast<std::size_t>(top + kLabelHeight + y) * width + left) * 3;
        std::memcpy(&sheet[to], &pixels[c * tile + y * line], line);
      }
    }
  }
  write_png(png, sheet, width, height, 3);
  return title;
}

}  // namespace mjsense
