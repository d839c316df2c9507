// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads the number of frames, the size and the codec of a video from its container, so that an
// encoder's output can be checked without starting another program. Supports MP4 and Matroska as
// written by ffmpeg.

#include <cstdint>
#include <string>

namespace mjsense::record {

struct VideoFacts {
  std::int64_t frames = 0;
  int width = 0, height = 0;
  std::string container;  // "MP4", "Matroska"
  std::string codec;      // "h264" or "ffv1"; others as the container names them: "mp4v"
  std::string error;      // "" if the file could be parsed to its end
};

// Reads only the tables of the file, at most 64 MiB, and validates all sizes in them.
[[nodiscard]] VideoFacts read_video_facts(int fd);

}  // namespace mjsense::record
