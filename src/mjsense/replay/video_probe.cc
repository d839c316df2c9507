// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/video_probe.h"

#include <fmt/format.h>

#include <cstdio>
#include <sstream>

#include "mjsense/core/error.h"
#include "mjsense/record/process.h"

namespace mjsense {

VideoProbe probe_video(const std::filesystem::path& path, bool decode, const std::string& ffmpeg) {
  VideoProbe probe;
  std::vector<std::string> command = {
      ffmpeg_program(ffmpeg), "-nostdin", "-hide_banner", "-loglevel", "error", "-xerror", "-i",
      path.string(),          "-map",     "0:v:0"};
  if (!decode) command.insert(command.end(), {"-c", "copy"});
  command.insert(command.end(), {"-f", "framecrc", "pipe:1"});
  std::string listing;
  try {
    listing = run_process(command);
  } catch (const Error& error) {
    probe.error = error.what();
    return probe;
  }
  // "#dimensions 0: 640x368", then one line a frame.
  std::istringstream lines(listing);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#dimensions")) {
      std::sscanf(line.c_str(), "#dimensions %*d: %dx%d", &probe.width, &probe.height);
    } else if (!line.empty() && line[0] != '#') {
      ++probe.frames;
    }
  }
  return probe;
}

std::vector<std::uint8_t> grab_frames(const std::filesystem::path& path,
                                      std::span<const int> frames, int width, int height,
                                      bool grey16, const std::string& ffmpeg) {
  std::string select;
  for (const int n : frames) select += fmt::format("{}eq(n\\,{})", select.empty() ? "" : "+", n);
  // New time stamps, else a constant frame rate would fill the gaps with copies.
  const std::string filters =
      fmt::format("select='{}',setpts=N/(FRAME_RATE*TB),scale={}:{}:flags={}", select, width,
                  height, grey16 ? "neighbor" : "area");
  const std::string raw =
      run_process({ffmpeg_program(ffmpeg), "-nostdin", "-hide_banner", "-loglevel", "error", "-i",
                   path.string(), "-map", "0:v:0", "-vf", filters, "-f", "rawvideo", "-pix_fmt",
                   grey16 ? "gray16le" : "rgb24", "pipe:1"});
  return {raw.begin(), raw.end()};
}

}  // namespace mjsense
