// SPDX-License-Identifier: Apache-2.0
#pragma once
// Frames to video files through ffmpeg programs: one thread feeds them all.
//
// A stream is one video of one episode. Usually it has its own ffmpeg from the first frame on. When
// the worlds have more streams than max_encoders, the surplus streams write raw frames to a file
// beside their video, and encoders take these files up as they come free; the video is the same,
// byte for byte. Either way the producer waits while `queue_frames` of its frames are not taken
// yet, so memory is bounded and no frame is lost. An ffmpeg that takes nothing, or does not end, for
// VideoCfg::ffmpeg_timeout is ended, and its stream has failed.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/record/folder.h"
#include "mjsense/record/layout.h"
#include "mjsense/record/recording.h"

namespace mjsense {

// What ffmpeg is told: raw frames from its stdin to the file `output` of the folder it runs in.
std::vector<std::string> encoder_command(const VideoCfg& cfg, const Fps& fps,
                                         const VideoStream& video, const std::string& output);

// Throws RuntimeError unless the ffmpeg program runs and has the encoders that the videos need.
void check_ffmpeg(const VideoCfg& cfg, std::span<const VideoStream> videos);

class EncoderPool {
 public:
  class Stream;
  struct Result {
    bool ok = false;
    bool aborted = false;
    std::string why;  // if not ok
  };
  // Called once per stream by the pool's thread, after its ffmpeg has ended.
  using OnDone = std::function<void(const Result&)>;

  // `streams_at_once`: the most streams that grow at the same time.
  EncoderPool(const VideoCfg& cfg, const Fps& fps, int streams_at_once,
              const std::atomic<int>* stop = nullptr);
  ~EncoderPool();  // kills what still runs

  // Waits for a free encoder, or for disk space to be drained. `video` outlives the stream, which
  // writes the file `output` of `folder`. Throws RuntimeError when ffmpeg cannot be started.
  Stream* open(const VideoStream& video, std::shared_ptr<const Folder> folder,
               const std::string& output, OnDone on_done);
  // The place of the next frame; waits while the queue is full. Empty when the stream has failed:
  // on_done tells why.
  [[nodiscard]] std::span<std::uint8_t> reserve(Stream* stream);
  void commit(Stream* stream);
  void close(Stream* stream);  // no more frames; the stream must not be used any more
  void abort(Stream* stream);  // no more frames, and the video is not wanted

  double cpu_s() const;  // processor time of the programs that have ended

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense
