// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads the properties of video files with the ffmpeg program only (not every installation has
// ffprobe). ffmpeg may open only this file, as MP4 with H.264 or Matroska with FFV1. Whatever the
// file contains, no other demuxer or decoder of ffmpeg processes it.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace mjsense::replay {

struct VideoProbe {
  int frames = 0, width = 0, height = 0;
  std::string error;  // "" if the video is readable
};

// Counts packets. With `decode`, decodes every frame and treats every message of the decoder as an
// error. Gives up after twice the `expected` frames, or if ffmpeg prints nothing for 60 s.
VideoProbe probe_video(const std::filesystem::path& path, bool decode, std::int64_t expected,
                       const std::string& ffmpeg);

// Extracts the frames with these indices, scaled: uint8 [n, height, width, 3], or uint16 [n,
// height, width] if `grey16`. Returns fewer if the video lacks some of them. Throws RuntimeError if
// the video cannot be read.
std::vector<std::uint8_t> grab_frames(const std::filesystem::path& path,
                                      std::span<const int> frames, int width, int height,
                                      bool grey16, const std::string& ffmpeg);

}  // namespace mjsense::replay
