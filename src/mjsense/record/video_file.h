// SPDX-License-Identifier: Apache-2.0
#pragma once
// How many pictures a video file holds, how large they are and how they are coded, from its container
// alone: what an
// encoder left is counted without starting another program. MP4 and Matroska as ffmpeg writes them.

#include <cstdint>
#include <string>

namespace mjsense {

struct VideoFacts {
  std::int64_t frames = 0;
  int width = 0, height = 0;
  std::string container;  // "MP4", "Matroska"
  std::string codec;      // "h264", "ffv1"; another one as the container names it: "mp4v"
  std::string error;      // "" if the file could be understood to its end
};

// Reads only the tables of the file, never more than 64 MiB, and trusts none of their sizes.
[[nodiscard]] VideoFacts read_video_facts(int fd);

}  // namespace mjsense
