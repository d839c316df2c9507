// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a video file holds, found with the ffmpeg program alone (not every installation has
// ffprobe). It opens this one file only, as MP4 with H.264 or as Matroska with FFV1: whatever else
// the bytes say, no other reader of ffmpeg sees them.

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

// Counts packets; with `decode`, decodes every frame, and every complaint of the decoder is an error. Gives up beyond
// twice the `expected` frames and when nothing comes for 60 s.
VideoProbe probe_video(const std::filesystem::path& path, bool decode, std::int64_t expected,
                       const std::string& ffmpeg);

// The frames of these numbers, scaled: uint8 [n, height, width, 3], or uint16 values [n, height,
// width] when `grey16`. Fewer where the video has no such frame. Throws RuntimeError when it cannot
// be read.
std::vector<std::uint8_t> grab_frames(const std::filesystem::path& path,
                                      std::span<const int> frames, int width, int height,
                                      bool grey16, const std::string& ffmpeg);

}  // namespace mjsense
