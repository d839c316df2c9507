// SPDX-License-Identifier: Apache-2.0
#pragma once
// The two sides of the recorder. The caller's side (recorder.cc, recorder_append.cc) copies rows
// into chunks and frames into queues. The writer thread (recorder_writer.cc) does everything that
// waits for a disk.

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

#include "mjsense/record/encoder_pool.h"
#include "mjsense/record/episode_file.h"
#include "mjsense/record/recorder.h"
#include "mjsense/record/recording_folder.h"
#include "mjsense/record/recording_plan.h"

namespace mjsense::record {

struct Recorder::Impl {
  using Clock = std::chrono::steady_clock;
  using Buffer = std::vector<std::uint8_t>;

  static double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  // Chunk buffers per stream and world: one is written while the next is filled.
  static constexpr int kBuffersPerWorld = 2;

  enum class Outcome { kRunning, kKept, kDiscarded, kAbandoned };

  // One attempt, from begin_episode() until its directory is renamed or removed.
  struct Episode {
    EpisodeMeta meta;
    std::shared_ptr<const Folder> folder;  // folder of its files, until the episode is kept
    Outcome outcome = Outcome::kRunning;
    std::int64_t rows = 0;
    bool refused = false;  // a row contained truncated text
    double waited_s = 0;   // waiting time for free buffers
    std::string why;
    std::vector<EncoderPool::Stream*> videos;
    std::vector<ImageHistogram> histograms;  // one per video; those of depth stay empty
    std::vector<Buffer> chunks;              // one per stream, being filled
    std::vector<std::int64_t> chunk_fill;    // rows in each chunk
    std::unique_ptr<EpisodeFile> file;       // used by the writer thread only
    std::atomic<int> parts{0};               // unfinished parts: HDF5 file and videos
  };
  using EpisodePtr = std::shared_ptr<Episode>;

  struct Job {
    enum Kind { kOpen, kChunk, kCarry, kClose, kSettle } kind;
    EpisodePtr episode;
    int stream = 0;
    std::int64_t rows = 0;
    Buffer chunk;
    std::string obs_scene, outcome;
    std::vector<EpisodeArray> arrays;
    EpisodeSource source;
  };

  RecordingCfg cfg;
  RecordingPlan plan;
  int streams;                         // array streams plus the recorder's own
  std::vector<std::size_t> row_bytes;  // bytes of a row in a chunk buffer, per stream
  std::vector<std::int64_t> chunk_rows_of;

  std::unique_ptr<RecordingFolder>
      house;  // modified by the writer thread, or while that thread is idle
  std::unique_ptr<EncoderPool> pool;

  mutable std::mutex mutex;
  std::vector<EpisodePtr> worlds;
  // Updated when the caller decides; `house` follows once the decision is on disk.
  Decisions decisions;
  std::condition_variable work, progress;
  std::deque<Job> jobs;
  std::vector<std::vector<Buffer>> free_chunks;  // per stream
  // Finished or abandoned episodes whose directories are not yet renamed or removed.
  int unsettled = 0;
  bool stop = false;
  std::exception_ptr failure;
  std::thread writer;

  std::atomic<int> saved{0};  // episodes that are completely on disk
  std::atomic<std::int64_t> rows{0}, frames{0}, published_bytes{0};
  std::atomic<double> copy_s{0}, wait_s{0}, write_s{0}, commit_s{0};

  explicit Impl(const RecordingCfg& cfg_);
  ~Impl();
  void set_start(const std::filesystem::path& dir);
  void check_names() const;

  // ---- the caller's side
  void rethrow() const;
  Episode& running(int world, const char* action) const;
  void check_world(int world) const;
  void begin(int world, const EpisodeMeta& meta);
  void check_number(std::int64_t number) const;
  void open_video(const EpisodePtr& episode, const VideoStream& video);
  void append(int world, const StepRow& row);
  // Throws if a text was truncated, because it is not valid JSON any more. Nothing of that step is
  // stored.
  void check_texts(int world, Episode& episode) const;
  // Converts an image for the encoder, and counts the levels of a colour image.
  void copy_frame(const VideoStream& video, int world, std::span<std::uint8_t> frame,
                  ImageHistogram& histogram) const;
  // Buffer for the next row of a stream, filled with zeros; null if the row has no bytes.
  std::uint8_t* next_row(Episode& episode, int s);
  void end_row(Episode& episode, int world, int s);
  Buffer take_buffer(Episode& episode, int s);
  void hand_over(const EpisodePtr& episode, int s);
  void finish(int world, std::string_view obs_scene, std::string_view outcome,
              std::vector<EpisodeArray> arrays);
  void carry_over(int world, EpisodeSource source);
  void skip(std::int64_t number, std::string_view why);
  void give_up(int world, Outcome outcome, std::string_view why);
  void leave(int world, const Episode& episode);
  void abort_videos(Episode& episode);
  [[noreturn]] void wait_for_failure();
  // Waits until every episode that is not running is kept or removed on disk.
  void flush();
  int running_count() const;
  void post(Job job);

  // ---- the encoder pool's thread
  void video_done(const EpisodePtr& episode, const EncoderPool::Result& result);
  void part_done(const EpisodePtr& episode);
  void fail(std::exception_ptr error);

  // ---- the writer thread
  void write_jobs();
  void run(Job& job, bool failed);
  void after(Job& job);
  void settle(Episode& episode, bool failed);
  // Counts the frames in the video files, because an encoder's exit code of 0 is not trusted.
  std::vector<EpisodeFile::VideoSum> check_videos(const Episode& episode) const;
};

}  // namespace mjsense::record
