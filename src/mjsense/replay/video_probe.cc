// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/video_probe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <sstream>

#include "mjsense/core/error.h"
#include "mjsense/record/process.h"

namespace mjsense::replay {

namespace {

constexpr double kSilenceLimit = 60;  // s without output
constexpr std::size_t kLineBytes = 96;
// A small file may claim images that take hours and all memory to decode. Real videos need a tenth
// of this time.
constexpr std::uint64_t kMinSeconds = 60, kBytesPerSecond = 50'000;
constexpr std::uint64_t kMemory = std::uint64_t{4} << 30;

record::ProcessLimits process_limits(const std::filesystem::path& path, double silence_s,
                                     std::size_t max_bytes) {
  std::error_code ignored;
  const auto bytes = std::filesystem::file_size(path, ignored);
  return {silence_s, {kMinSeconds + (ignored ? 0 : bytes / kBytesPerSecond), kMemory}, max_bytes};
}

// "-f mov -c:v h264 -i file:/data/x.mp4"
std::vector<std::string> input_of(const std::filesystem::path& path) {
  const bool matroska = path.extension() == ".mkv";
  return {"-protocol_whitelist",
          "file",
          "-f",
          matroska ? "matroska" : "mov",
          "-codec_whitelist",
          "h264,ffv1",
          "-threads",  // each thread takes memory, and many videos are read at the same time
          "1",
          "-an",
          "-sn",
          "-dn",
          "-i",
          "file:" + path.string()};
}

std::vector<std::string> command_of(const std::filesystem::path& path, const std::string& ffmpeg,
                                    std::initializer_list<std::string> options) {
  std::vector<std::string> command = {record::ffmpeg_program(ffmpeg), "-nostdin", "-hide_banner",
                                      "-loglevel", "error"};
  command.insert(command.end(), options);
  const auto input = input_of(path);
  command.insert(command.end(), input.begin(), input.end());
  command.insert(command.end(), {"-map", "0:v:0"});
  return command;
}

}  // namespace

VideoProbe probe_video(const std::filesystem::path& path, bool decode, std::int64_t expected,
                       const std::string& ffmpeg) {
  VideoProbe probe;
  std::vector<std::string> command =
      command_of(path, ffmpeg, {"-xerror", "-err_detect", "crccheck+bitstream+buffer+explode"});
  if (!decode) command.insert(command.end(), {"-c", "copy"});
  command.insert(command.end(), {"-f", "framecrc", "pipe:1"});
  std::string listing;
  try {
    const auto maximum = static_cast<std::size_t>(2 * std::max<std::int64_t>(0, expected) + 100);
    std::string stderr_tail;
    listing = record::run_process(
        command, process_limits(path, kSilenceLimit, maximum * kLineBytes), &stderr_tail);
    // ffmpeg only prints a message about damaged FFV1 slices and exits with success.
    if (decode && !stderr_tail.empty()) probe.error = stderr_tail;
  } catch (const Error& error) {
    probe.error = error.what();
  }
  if (!probe.error.empty()) return probe;
  // "#dimensions 0: 640x368", then one line per frame.
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
  // The selected frames get new time stamps, one frame per second; otherwise a constant frame rate
  // would fill the gaps with copies. The rate is given explicitly, because FFmpeg 7 does not know
  // FRAME_RATE after `select` and repeats a frame.
  const std::string filters = fmt::format("select='{}',setpts=N/TB,fps=1,scale={}:{}:flags={}",
                                          select, width, height, grey16 ? "neighbor" : "area");
  std::vector<std::string> command = command_of(path, ffmpeg, {});
  command.insert(command.end(),
                 {"-vf", filters, "-frames:v", fmt::format("{}", frames.size()), "-f", "rawvideo",
                  "-pix_fmt", grey16 ? "gray16le" : "rgb24", "pipe:1"});
  const std::size_t maximum = frames.size() * width * height * 3 + 1;
  const std::string raw =
      record::run_process(command, process_limits(path, 2 * kSilenceLimit, maximum));
  return {raw.begin(), raw.end()};
}

}  // namespace mjsense::replay
