// SPDX-License-Identifier: Apache-2.0
#pragma once
// Episodes -> HDF5 + video, streamed while they run.
//
//   Recorder recorder(cfg);                     opens or resumes {out}/house_{id}/
//   recorder.begin_episode(w, {episode, seed});
//   recorder.append(w, {reward, ...});          once per observation: row w of every sensor
//   recorder.finish_episode(w, obs_scene);      kept
//   recorder.discard_episode(w, why);           or: attempted, not kept
//   recorder.complete();                        publishes everything, ends the recording
//
// append() copies and returns; one thread feeds the encoders, one writes HDF5. Memory does not grow
// with the length of an episode: when an encoder or the disk is slower than the simulation,
// append() waits. No frame is ever dropped.
//
// Crash safety: an episode is written into {house}/.recording/episode_N.part and becomes
// {house}/.recording/episode_N by one rename once all its files are whole and on disk. As soon as
// all attempts up to the end of a batch are decided, the batch is published: videos are moved to
// their final names, the HDF5 file last. At any moment a finished episode is readable in one of the
// two places, and a new Recorder with cfg.resume goes on from there.
//
// A fault (disk full, ffmpeg killed, text cut) throws one RuntimeError or ValueError from the next
// call, naming file and reason. Calls for different worlds may come from different threads.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/record/recording.h"

namespace mjsense {

// How the time and the bytes of a recording were spent so far.
struct RecordStats {
  std::int64_t rows = 0;             // observations of all worlds
  std::int64_t frames = 0;           // video frames of all cameras
  std::int64_t raw_bytes = 0;        // rows and frames as the sensors hold them
  std::int64_t published_bytes = 0;  // files under their final names
  double copy_s = 0;                 // append(): copying rows and frames
  double wait_s = 0;                 // append(), begin_episode(): waiting for encoders or the disk
  double write_s = 0;                // writer thread: compressing and writing HDF5
  double commit_s = 0;               // writer thread: syncing, renaming, publishing
  double encode_cpu_s = 0;           // processor time of the ffmpeg programs
};

class Recorder {
 public:
  // Validates everything: streams and their places, output directory, ffmpeg. Throws ValueError or
  // RuntimeError.
  explicit Recorder(const RecordingCfg& cfg);
  // Abandons what is running (it can be attempted again); finished episodes stay.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void begin_episode(int world, const EpisodeMeta& meta);
  // The sensors' rows of `world` must be fresh. Throws ValueError when a dict row holds cut text:
  // discard the episode then.
  void append(int world, const StepRow& row);
  // `obs_scene`: JSON text. `outcome`: one word or sentence, kept as an attribute.
  void finish_episode(int world, std::string_view obs_scene, std::string_view outcome = "");
  // Decided, not kept: a resumed recording does not attempt it again.
  void discard_episode(int world, std::string_view why = "");
  // Undecided: a resumed recording attempts it again.
  void abandon_episode(int world);

  [[nodiscard]] bool recording(int world) const;
  // True if this attempt was finished or discarded, now or before the recording was resumed.
  [[nodiscard]] bool decided(std::int64_t episode) const;
  int kept() const;   // episodes finished so far, published or not
  int saved() const;  // of these, those that are whole on disk: no fault takes them any more
  // What an earlier process left and was found broken, a sentence each: set aside, attempted again.
  [[nodiscard]] std::vector<std::string> damage() const;
  int discarded() const;
  // cfg.episodes are kept and no earlier attempt is undecided: nothing more to attempt.
  [[nodiscard]] bool enough() const;

  // Waits until every finished episode is safe on disk.
  void flush();
  // flush(), then publishes also batches that lack episodes and removes {house}/.recording. No more
  // episodes after that.
  void complete();

  std::filesystem::path house_dir() const;
  RecordStats stats() const;
  std::size_t bytes_per_world() const;  // memory for buffers and queues

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense
