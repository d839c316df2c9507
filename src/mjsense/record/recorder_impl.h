// SPDX-License-Identifier: Apache-2.0
#pragma once
// The recorder's two sides: the caller's (recorder.cc, recorder_append.cc), which copies rows into
// chunks and frames into queues, and the writer thread's (recorder_writer.cc), which does
// everything that waits for a disk.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "mjsense/record/encoder.h"
#include "mjsense/record/episode_file.h"
#include "mjsense/record/layout.h"
#include "mjsense/record/recorder.h"
#include "mjsense/record/recording_folder.h"

namespace mjsense {

struct Recorder::Impl {
  using Clock = std::chrono::steady_clock;
  using Buffer = std::vector<std::uint8_t>;

  static double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  // Chunks of one stream that wait for the writer, per world: while one is written the next is
  // filled.
  static constexpr int kBuffersPerWorld = 2;

  enum class Fate { kRunning, kKept, kDiscarded, kAbandoned };

  // One attempt, from begin_episode() until its directory is renamed or removed.
  struct Episode {
    EpisodeMeta meta;
    std::shared_ptr<const Folder> folder;  // its files, until they are kept
    Fate fate = Fate::kRunning;
    std::int64_t rows = 0;
    bool refused = false;  // a row held cut text
    double waited_s = 0;   // for free buffers
    std::string why;
    std::vector<EncoderPool::Stream*> videos;
    std::vector<Buffer> chunks;            // one a stream, being filled
    std::vector<std::int64_t> chunk_fill;  // rows in it
    std::unique_ptr<EpisodeFile> file;     // the writer thread's
    std::atomic<int> parts{0};             // HDF5 file and videos that are not done
  };
  using EpisodePtr = std::shared_ptr<Episode>;

  struct Job {
    enum Kind { kOpen, kChunk, kClose, kSettle } kind;
    EpisodePtr episode;
    int stream = 0;
    std::int64_t rows = 0;
    Buffer chunk;
    std::string obs_scene, outcome;
  };

  RecordingCfg cfg;
  RecordingPlan plan;
  int streams;                         // arrays and the recorder's own
  std::vector<std::size_t> row_bytes;  // of a stream in a chunk that is filled
  std::vector<std::int64_t> chunk_rows_of;

  std::unique_ptr<RecordingFolder>
      house;  // changed by the writer thread, or while it has nothing to do
  std::unique_ptr<EncoderPool> pool;

  mutable std::mutex mutex;
  std::vector<EpisodePtr> worlds;
  Decisions decisions;  // as the caller took them; the house follows as they become durable
  std::condition_variable work, progress;
  std::deque<Job> jobs;
  std::vector<std::vector<Buffer>> free_chunks;  // per stream
  int unsettled = 0;  // episodes finished or given up whose directories are not settled
  bool stop = false;
  std::exception_ptr failure;
  std::thread writer;

  std::atomic<int> saved{0};  // episodes that are whole on disk
  std::atomic<std::int64_t> rows{0}, frames{0}, published_bytes{0};
  std::atomic<double> copy_s{0}, wait_s{0}, write_s{0}, commit_s{0};

  explicit Impl(const RecordingCfg& cfg_);
  ~Impl();
  void check_names() const;

  // ---- the producer's side
  void rethrow() const;
  Episode& running(int world, const char* deed) const;
  void check_world(int world) const;
  void begin(int world, const EpisodeMeta& meta);
  void check_begin(int world, std::int64_t number) const;
  void open_video(const EpisodePtr& episode, const VideoStream& video);
  void append(int world, const StepRow& row);
  // Text that was cut is no JSON any more. Nothing of the step is stored then.
  void check_texts(int world, Episode& episode) const;
  void copy_frame(const VideoStream& video, int world, std::span<std::uint8_t> frame) const;
  // Where the next row of a stream goes, zero all over; null if it has no bytes.
  std::uint8_t* next_row(Episode& episode, int s);
  void end_row(Episode& episode, int world, int s);
  Buffer take_buffer(Episode& episode, int s);
  void hand_over(const EpisodePtr& episode, int s);
  void finish(int world, std::string_view obs_scene, std::string_view outcome);
  void give_up(int world, Fate fate, std::string_view why);
  void leave(int world, const Episode& episode);
  void abort_videos(Episode& episode);
  [[noreturn]] void wait_for_failure();
  // Waits until every episode that is not running is settled.
  void flush();
  int running_count() const;
  void post(Job job);

  // ---- the encoders' thread
  void video_done(const EpisodePtr& episode, const EncoderPool::Result& result);
  void part_done(const EpisodePtr& episode);
  void fail(std::exception_ptr error);

  // ---- the writer thread
  void write_jobs();
  void run(Job& job, bool failed);
  void after(Job& job);
  void settle(Episode& episode, bool failed);
  // Counts what the encoders left: an exit code of 0 is believed of nobody.
  std::vector<EpisodeFile::VideoSum> check_videos(const Episode& episode) const;
};

}  // namespace mjsense
