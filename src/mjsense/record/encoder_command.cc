// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/record/encoder_pool.h"
#include "mjsense/record/process.h"
#include "mjsense/record/spawn.h"

namespace mjsense::record {
std::vector<std::string> encoder_command(const VideoCfg& cfg, const Fps& fps,
                                         const VideoStream& video, const std::string& output) {
  // Frames already have the pixel format of the codec, so that ffmpeg does not convert them.
  constexpr const char* kPixels[] = {"yuv420p", "gray16le", "rgb24"};
  const char* pixels = kPixels[static_cast<int>(video.kind)];
  const int odd = video.kind == VideoKind::kRgb ? 1 : 0;  // 4:2:0 needs even sizes
  std::vector<std::string> a = {ffmpeg_program(cfg.ffmpeg)};
  const auto add = [&a](std::initializer_list<std::string> more) { a.insert(a.end(), more); };
  add({"-nostdin", "-hide_banner", "-loglevel", "error", "-y"});
  add({"-f", "rawvideo", "-pixel_format", pixels});
  add({"-video_size", fmt::format("{}x{}", video.width + (video.width & odd),
                                  video.height + (video.height & odd))});
  add({"-framerate", fmt::format("{}/{}", fps.num, fps.den)});
  add({"-protocol_whitelist", "pipe", "-i", "pipe:0"});
  add({"-an", "-threads", fmt::format("{}", cfg.threads)});
  switch (video.kind) {
    case VideoKind::kRgb:
      // Without B-frames, every frame needs only frames before it: random access decodes fewer
      // frames, and the order in the file is the order in time, as MCAP's readers require.
      add({"-c:v", "libx264", "-pix_fmt", pixels, "-preset", cfg.preset, "-crf",
           fmt::format("{}", cfg.crf), "-bf", "0", "-g", fmt::format("{}", cfg.keyint)});
      if (!cfg.tune.empty()) add({"-tune", cfg.tune});
      break;
    case VideoKind::kDepth16:
      add({"-c:v", "ffv1", "-level", "3", "-g", "1", "-slicecrc", "1", "-pix_fmt", pixels});
      break;
    case VideoKind::kDepthRedGreen:
      add({"-c:v", "libx264rgb", "-pix_fmt", pixels, "-crf", "23"});
      break;
  }
  add({"-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1", "-f",
       video.extension == ".mkv" ? "matroska" : "mp4", "file:" + output});
  return a;
}

SystemLimits encoder_limits(const VideoCfg& cfg, const VideoStream& video) {
  // Measured with libx264: 53 MiB at 640 x 368 and 193 MiB at 1920 x 1080 with the defaults; 811 MiB
  // with 4 threads and the preset veryslow, and 20 MiB for each thread with 64 or 128 of them.
  constexpr std::uint64_t kMiB = 1 << 20, kFrames = 400, kFramesPerThread = 16;
  constexpr int kMaxThreads = 256;  // of x264, which 0 may mean
  const auto threads = static_cast<std::uint64_t>(cfg.threads > 0 ? cfg.threads : kMaxThreads);
  return {.memory = 1024 * kMiB + threads * 64 * kMiB +
                    (kFrames + threads * kFramesPerThread) * video.frame_bytes()};
}

void check_ffmpeg(const VideoCfg& cfg, std::span<const VideoStream> videos) {
  if (videos.empty()) return;
  const std::string program = ffmpeg_program(cfg.ffmpeg);
  std::string listing;
  try {
    listing = run_process({program, "-hide_banner", "-loglevel", "error", "-encoders"},
                          {.silence_s = cfg.ffmpeg_timeout,
                           .system = {.cpu_s = 60, .memory = std::uint64_t{4} << 30},
                           .max_bytes = 1 << 24});
  } catch (const CannotStart& error) {
    throw RuntimeError(
        fmt::format("recording {} needs ffmpeg: {}; install it (apt-get install ffmpeg, or for "
                    "Python pip install 'mjsense[video]') or set $MJSENSE_FFMPEG to its path",
                    counted(videos.size(), "video stream"), error.what()));
  } catch (const Error& error) {
    throw RuntimeError(
        fmt::format("recording {} needs ffmpeg, but '{}' did not list its encoders: {}",
                    counted(videos.size(), "video stream"), program, error.what()));
  }
  constexpr const char* kEncoders[] = {"libx264", "ffv1", "libx264rgb"};
  for (const VideoStream& video : videos) {
    const char* encoder = kEncoders[static_cast<int>(video.kind)];
    if (listing.find(fmt::format(" {} ", encoder)) == std::string::npos) {
      throw RuntimeError(
          fmt::format("the ffmpeg program '{}' has no encoder '{}', which video '{}' needs",
                      program, encoder, video.key));
    }
  }
}

}  // namespace mjsense::record
