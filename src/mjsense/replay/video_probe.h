// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a video file holds, found with the ffmpeg program alone (not every installation has
// ffprobe).

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace mjsense {

struct VideoProbe {
  int frames = 0, width = 0, height = 0;
  std::string error;  // "" if the file is a readable video
};

// Counts packets; with `decode`, decodes every frame.
VideoProbe probe_video(const std::filesystem::path& path, bool decode, const std::string& ffmpeg);

// The frames of these numbers, scaled: uint8 [n, height, width, 3], or uint16 values [n, height,
// width] when `grey16`. Fewer where the video has no such frame. Throws RuntimeError when it cannot
// be read.
std::vector<std::uint8_t> grab_frames(const std::filesystem::path& path,
                                      std::span<const int> frames, int width, int height,
                                      bool grey16, const std::string& ffmpeg);

}  // namespace mjsense
