// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of the videos of a recording.

#include <string>

namespace mjsense::record {

struct VideoCfg {
  std::string ffmpeg;
  int max_encoders = 0;
  int queue_frames = 3;
  int threads = 1;
  int crf = 25;
  std::string preset = "veryfast";
  std::string tune = "fastdecode";
  int keyint = 20;
  double depth_unit = 0.0002;
  double ffmpeg_timeout = 60;
  bool molmospaces_depth = false;
};
template <class V>
void visit_fields(V& v, VideoCfg& c) {
  v.object("VideoCfg", "How images are stored.");
  v("ffmpeg", c.ffmpeg,
    "Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.");
  v("crf", c.crf, "Quality of the videos, from 0 (lossless) to 51 (worst).").within(0, 51);
  v("preset", c.preset,
    "Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.");
  v("tune", c.tune,
    "Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and "
    "files are a seventh larger.");
  v("keyint", c.keyint,
    "Maximum number of frames between key frames. A small value makes random access faster, a "
    "large value makes files smaller.")
      .at_least(1);
  v("molmospaces_depth", c.molmospaces_depth,
    "Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video.");
  v("max_encoders", c.max_encoders,
    "Maximum number of concurrent ffmpeg processes; 0: 32. Further streams wait in raw files on "
    "disk.")
      .at_least(0)
      .hidden();
  v("queue_frames", c.queue_frames,
    "Number of frames of a stream that are buffered in memory; when the buffer is full, the "
    "simulation waits.")
      .at_least(1)
      .hidden();
  v("encoder_threads", c.threads,
    "Number of threads of each encoder. The bytes of a video depend on it, so it does not follow "
    "the number of CPUs.")
      .at_least(1)
      .hidden();
  v("ffmpeg_timeout", c.ffmpeg_timeout,
    "Time after which an ffmpeg process that accepts no frame, or does not finish, is killed.")
      .unit("s")
      .positive()
      .hidden();
  v("depth_unit", c.depth_unit,
    "Unit of the 16-bit depth video; 0.0002 m covers distances up to 13.1 m.")
      .unit("m")
      .positive()
      .hidden();
}

}  // namespace mjsense::record
