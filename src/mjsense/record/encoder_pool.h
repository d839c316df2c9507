// SPDX-License-Identifier: Apache-2.0
#pragma once
// Encodes frames to video files with ffmpeg processes that one thread feeds.
//
// A stream is one video of one episode. Usually it has an ffmpeg process from its first frame. If
// the worlds have more streams than max_encoders, the surplus streams write raw frames to a spool
// file next to their video. These files are encoded when an encoder becomes free; the video is the
// same byte for byte. In both cases the producer waits while `queue_frames` of its frames are
// pending, so memory is bounded and no frame is lost. An ffmpeg process that accepts no input, or
// does not exit, for VideoCfg::ffmpeg_timeout is killed, and its stream fails.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/record/folder.h"
#include "mjsense/record/recording.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/record/spawn.h"

namespace mjsense::record {

// Command line of ffmpeg: it reads raw frames from stdin and writes the file `output` in its
// working directory.
std::vector<std::string> encoder_command(const VideoCfg& cfg, const Fps& fps,
                                         const VideoStream& video, const std::string& output);

// Its limits: several times the memory that encoding takes. Its CPU time is not limited, because an
// episode may have any length; VideoCfg::ffmpeg_timeout ends an encoder without progress.
SystemLimits encoder_limits(const VideoCfg& cfg, const VideoStream& video);

// Throws RuntimeError unless the ffmpeg program runs and has the encoders that the videos need.
void check_ffmpeg(const VideoCfg& cfg, std::span<const VideoStream> videos);

class EncoderPool {
 public:
  class Stream;
  struct Result {
    bool ok = false;
    bool aborted = false;
    std::string why;  // reason, if not ok
  };
  // Called once per stream by the pool's thread, after the stream's ffmpeg process has ended.
  using OnDone = std::function<void(const Result&)>;

  // `streams_at_once`: maximum number of streams that are open at the same time.
  EncoderPool(const VideoCfg& cfg, const Fps& fps, int streams_at_once,
              const std::atomic<int>* stop = nullptr);
  ~EncoderPool();  // kills the processes that still run, and what they have started

  // Waits for a free encoder or, with spool files, until few enough of them are pending. `video`
  // must outlive the stream, which writes the file `output` of `folder`. Throws RuntimeError if
  // ffmpeg cannot be started.
  Stream* open(const VideoStream& video, std::shared_ptr<const Folder> folder,
               const std::string& output, OnDone on_done);
  // Buffer for the next frame. Waits while the queue is full. Empty if the stream has failed;
  // on_done receives the reason.
  [[nodiscard]] std::span<std::uint8_t> reserve(Stream* stream);
  void commit(Stream* stream);
  void close(Stream* stream);  // ends the stream, which must not be used afterwards
  void abort(Stream* stream);  // the same, and discards the video

  double cpu_s() const;  // CPU time of the ffmpeg processes that have ended

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense::record
