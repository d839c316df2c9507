#include "mjsense/record/recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "mjsense/core/error.h"
#include "mjsense/record/depth.h"
#include "mjsense/record/encoder.h"
#include "mjsense/record/episode_file.h"
#include "mjsense/record/house.h"
#include "mjsense/record/layout.h"

namespace mjsense {
namespace {

using Clock = std::chrono::steady_clock;
using Buffer = std::vector<std::uint8_t>;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Chunks of one stream that wait for the writer, per world: while one is written the next is
// filled.
constexpr int kBuffersPerWorld = 2;

enum class Fate { kRunning, kKept, kDiscarded, kAbandoned };

// One attempt, from begin_episode() until its directory is renamed or removed.
struct Episode {
  EpisodeMeta meta;
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

void validate(const RecordingCfg& cfg) {
  const auto require = [](bool ok, const char* what, auto value, const char* expected) {
    if (!ok)
      throw ValueError(fmt::format("recording: {} is {}, expected {}", what, value, expected));
  };
  if (cfg.out_dir.empty()) throw ValueError("recording: no output directory was given");
  require(cfg.num_worlds > 0, "num_worlds", cfg.num_worlds, "at least 1");
  require(cfg.house >= 0, "house", cfg.house, "0 or more");
  require(cfg.fps.num > 0 && cfg.fps.den > 0, "fps", fmt::format("{}/{}", cfg.fps.num, cfg.fps.den),
          "a positive fraction");
  require(cfg.gzip >= 0 && cfg.gzip <= 9, "gzip", cfg.gzip, "0 to 9");
  require(cfg.video.crf >= 0 && cfg.video.crf <= 51, "crf", cfg.video.crf, "0 to 51");
  require(cfg.video.keyint > 0, "keyint", cfg.video.keyint, "at least 1");
  require(cfg.video.threads > 0, "threads per encoder", cfg.video.threads, "at least 1");
  require(cfg.video.queue_frames > 0, "queue_frames", cfg.video.queue_frames, "at least 1");
  require(cfg.video.max_encoders >= 0, "max_encoders", cfg.video.max_encoders, "0 (32) or more");
  require(cfg.video.depth_unit > 0, "depth_unit", cfg.video.depth_unit,
          "metres per unit, positive");
}

}  // namespace

struct Recorder::Impl {
  RecordingCfg cfg;
  RecordingPlan plan;
  int streams;  // arrays and the recorder's own
  std::vector<std::size_t> row_bytes;
  std::vector<std::int64_t> chunk_rows_of;

  std::unique_ptr<House> house;  // changed by the writer thread, or while it has nothing to do
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

  std::atomic<std::int64_t> rows{0}, frames{0}, published_bytes{0};
  std::atomic<double> copy_s{0}, wait_s{0}, write_s{0}, commit_s{0};

  explicit Impl(const RecordingCfg& cfg_) : cfg(cfg_) {
    validate(cfg);
    batch_sizes(cfg.episodes, cfg.batches);
    plan = plan_recording(cfg);
    check_names();
    check_ffmpeg(cfg.video, plan.videos);
    house = std::make_unique<House>(cfg.out_dir / fmt::format("house_{}", cfg.house),
                                    plan.fingerprint, cfg.resume);
    if (!house->ended()) house->publish_ready();
    decisions = house->decisions();
    for (const ArrayStream& stream : plan.arrays) {
      row_bytes.push_back(stream.field->data.row_bytes());
      chunk_rows_of.push_back(stream.chunk_rows);
    }
    for (int i = 0; i < kOwnStreams; ++i) {
      row_bytes.push_back(dtype_size(own_dtype(i)));
      chunk_rows_of.push_back(chunk_rows(row_bytes.back()));
    }
    streams = static_cast<int>(row_bytes.size());
    worlds.resize(cfg.num_worlds);
    free_chunks.resize(streams);
    for (int s = 0; s < streams; ++s)
      free_chunks[s].resize(static_cast<std::size_t>(kBuffersPerWorld) * cfg.num_worlds);
    if (!plan.videos.empty()) {
      pool = std::make_unique<EncoderPool>(cfg.video, cfg.fps,
                                           static_cast<int>(plan.videos.size()) * cfg.num_worlds);
    }
    writer = std::thread([this] { write_jobs(); });
  }

  ~Impl() {
    for (int w = 0; w < cfg.num_worlds; ++w) {
      if (worlds[w]) give_up(w, Fate::kAbandoned, "");
    }
    {
      std::unique_lock lock(mutex);
      progress.wait(lock, [&] { return unsettled == 0; });
      stop = true;
    }
    work.notify_all();
    writer.join();
    pool.reset();
  }

  void check_names() const {
    const int batches = static_cast<int>(batch_sizes(cfg.episodes, cfg.batches).size());
    for (const VideoStream& video : plan.videos) {
      const std::string name = video_file(video, cfg.episodes, batches - 1, batches);
      if (name.size() > kFileNameBytes) {
        throw ValueError(
            fmt::format("sensor '{}': its video would be named '{}', {} bytes; at most {} fit",
                        video.sensor->name(), name, name.size(), kFileNameBytes));
      }
    }
  }

  // ---- the producer's side

  void rethrow() const {
    const std::lock_guard lock(mutex);
    if (failure) std::rethrow_exception(failure);
  }

  Episode& running(int world, const char* deed) const {
    check_world(world);
    if (!worlds[world])
      throw ValueError(fmt::format("cannot {}: no episode was begun in world {}", deed, world));
    return *worlds[world];
  }

  void check_world(int world) const {
    if (world < 0 || world >= cfg.num_worlds) {
      throw ValueError(
          fmt::format("recording: no world {}, expected 0 to {}", world, cfg.num_worlds - 1));
    }
  }

  void begin(int world, const EpisodeMeta& meta) {
    check_world(world);
    const auto episode = std::make_shared<Episode>();
    episode->meta = meta;
    episode->parts = 1;
    episode->chunks.resize(streams);
    episode->chunk_fill.assign(streams, 0);
    {
      const std::lock_guard lock(mutex);
      if (failure) std::rethrow_exception(failure);
      check_begin(world, meta.episode);
      house->begin(meta.episode);
      worlds[world] = episode;
      ++unsettled;
    }
    post({Job::kOpen, episode});
    const Clock::time_point start = Clock::now();
    try {
      for (const VideoStream& video : plan.videos) open_video(episode, video);
    } catch (...) {
      give_up(world, Fate::kAbandoned, "");
      throw;
    }
    wait_s += seconds_since(start);
  }

  void check_begin(int world, std::int64_t number) const {
    if (worlds[world]) {
      throw ValueError(fmt::format("world {} still records episode {}: finish or discard it first",
                                   world, worlds[world]->meta.episode));
    }
    if (house->ended())
      throw ValueError(fmt::format("'{}' is complete: no more episodes", house->dir().string()));
    if (number < 0) throw ValueError(fmt::format("recording: episode {} is negative", number));
    if (decisions.contains(number))
      throw ValueError(
          fmt::format("recording: episode {} is already recorded or discarded", number));
    for (const EpisodePtr& other : worlds) {
      if (other && other->meta.episode == number) {
        throw ValueError(
            fmt::format("recording: episode {} already runs in another world", number));
      }
    }
  }

  void open_video(const EpisodePtr& episode, const VideoStream& video) {
    ++episode->parts;
    try {
      episode->videos.push_back(pool->open(
          video, part_dir(*episode) / (video.stem + video.extension),
          [this, episode](const EncoderPool::Result& result) { video_done(episode, result); }));
    } catch (...) {
      --episode->parts;
      throw;
    }
  }

  std::filesystem::path part_dir(const Episode& episode) const {
    return house->part_dir(episode.meta.episode);
  }

  void append(int world, const StepRow& row) {
    Episode& episode = running(world, "append a step");
    rethrow();
    check_texts(world, episode);
    for (std::size_t v = 0; v < plan.videos.size(); ++v) {
      const Clock::time_point asked = Clock::now();
      const std::span<std::uint8_t> frame = pool->reserve(episode.videos[v]);
      wait_s += seconds_since(asked);
      if (frame.empty()) {
        abort_videos(episode);  // so that the encoder's own words are collected
        wait_for_failure();
      }
      const Clock::time_point start = Clock::now();
      copy_frame(plan.videos[v], world, frame);
      copy_s += seconds_since(start);
      pool->commit(episode.videos[v]);
    }
    const Clock::time_point start = Clock::now();
    const double waited = episode.waited_s;
    for (std::size_t s = 0; s < plan.arrays.size(); ++s) {
      const Field& field = *plan.arrays[s].field;
      const std::byte* from = field.data.row_data(world);
      // Of a dict row only the text is copied: what follows is zero here as there.
      const std::size_t bytes = field.spec.is_dict
                                    ? strnlen(reinterpret_cast<const char*>(from), row_bytes[s])
                                    : row_bytes[s];
      put_row(episode, world, static_cast<int>(s), from, bytes);
    }
    const bool fail = !row.success;
    const void* own[kOwnStreams] = {&row.reward, &row.success, &fail, &row.terminated,
                                    &row.truncated};
    for (int i = 0; i < kOwnStreams; ++i) {
      const int s = static_cast<int>(plan.arrays.size()) + i;
      put_row(episode, world, s, own[i], row_bytes[s]);
    }
    ++episode.rows;
    rows += 1;
    frames += static_cast<std::int64_t>(plan.videos.size());
    copy_s += seconds_since(start) - (episode.waited_s - waited);
  }

  // Text that was cut is no JSON any more. Nothing of the step is stored then.
  void check_texts(int world, Episode& episode) const {
    for (const ArrayStream& stream : plan.arrays) {
      if (!stream.field->spec.is_dict) continue;
      const char* text = reinterpret_cast<const char*>(stream.field->data.row_data(world));
      const std::size_t most = stream.field->data.row_bytes();
      const std::size_t size = strnlen(text, most);
      if (size < most || (size > 0 && (text[size - 1] == '}' || text[size - 1] == ']'))) continue;
      episode.refused = true;
      throw ValueError(
          fmt::format("sensor '{}': step {} of episode {}: its text does not fit str_max_len = {}; "
                      "the episode cannot be kept",
                      stream.sensor->name(), episode.rows, episode.meta.episode, most));
    }
  }

  void copy_frame(const VideoStream& video, int world, std::span<std::uint8_t> frame) const {
    const std::byte* from = video.field->data.row_data(world);
    const std::size_t pixels = static_cast<std::size_t>(video.width) * video.height;
    const std::span<const float> metres(reinterpret_cast<const float*>(from), pixels);
    switch (video.kind) {
      case VideoKind::kRgb:
        std::memcpy(frame.data(), from, frame.size());
        break;
      case VideoKind::kDepth16:
        encode_depth16(metres, cfg.video.depth_unit,
                       {reinterpret_cast<std::uint16_t*>(frame.data()), pixels});
        break;
      case VideoKind::kDepthRedGreen:
        encode_depth_red_green(metres, frame);
        break;
    }
  }

  void put_row(Episode& episode, int world, int s, const void* from, std::size_t bytes) {
    Buffer& chunk = episode.chunks[s];
    if (episode.chunk_fill[s] == 0 && chunk.empty() && row_bytes[s] > 0)
      chunk = take_buffer(episode, s);
    if (bytes > 0)
      std::memcpy(chunk.data() + static_cast<std::size_t>(episode.chunk_fill[s]) * row_bytes[s],
                  from, bytes);
    if (++episode.chunk_fill[s] == chunk_rows_of[s]) hand_over(worlds[world], s);
  }

  Buffer take_buffer(Episode& episode, int s) {
    Buffer buffer;
    {
      std::unique_lock lock(mutex);
      if (free_chunks[s].empty()) {
        const Clock::time_point start = Clock::now();
        progress.wait(lock, [&] { return !free_chunks[s].empty(); });
        episode.waited_s += seconds_since(start);
        wait_s += seconds_since(start);
      }
      buffer = std::move(free_chunks[s].back());
      free_chunks[s].pop_back();
    }
    buffer.assign(static_cast<std::size_t>(chunk_rows_of[s]) * row_bytes[s], 0);
    return buffer;
  }

  void hand_over(const EpisodePtr& episode, int s) {
    Job job{Job::kChunk, episode, s, episode->chunk_fill[s], std::move(episode->chunks[s])};
    episode->chunks[s] = {};
    episode->chunk_fill[s] = 0;
    post(std::move(job));
  }

  void finish(int world, std::string_view obs_scene, std::string_view outcome) {
    Episode& episode = running(world, "finish an episode");
    rethrow();
    if (episode.refused) {
      throw ValueError(
          fmt::format("recording: episode {} was refused (a text did not fit): discard it",
                      episode.meta.episode));
    }
    if (episode.rows == 0)
      throw ValueError(fmt::format("recording: episode {} has no steps", episode.meta.episode));
    if (!nlohmann::json::accept(obs_scene)) {
      throw ValueError(fmt::format("recording: obs_scene of episode {} is no JSON text: {:.80}",
                                   episode.meta.episode, obs_scene));
    }
    const EpisodePtr kept = worlds[world];
    for (int s = 0; s < streams; ++s) {
      if (kept->chunk_fill[s] > 0) hand_over(kept, s);
    }
    kept->fate = Fate::kKept;
    Job close{Job::kClose, kept};
    close.obs_scene = obs_scene;
    close.outcome = outcome;
    post(std::move(close));
    for (EncoderPool::Stream* stream : kept->videos) pool->close(stream);
    kept->videos.clear();
    leave(world, *kept);
  }

  void give_up(int world, Fate fate, std::string_view why) {
    const EpisodePtr episode = worlds[world];
    episode->fate = fate;
    episode->why = why;
    abort_videos(*episode);
    {
      const std::lock_guard lock(mutex);
      for (int s = 0; s < streams; ++s) {
        if (!episode->chunks[s].empty()) free_chunks[s].push_back(std::move(episode->chunks[s]));
      }
    }
    post({Job::kClose, episode});
    leave(world, *episode);
  }

  void leave(int world, const Episode& episode) {
    const std::lock_guard lock(mutex);
    worlds[world].reset();
    if (episode.fate != Fate::kAbandoned)
      decisions.kept_by_episode[episode.meta.episode] = episode.fate == Fate::kKept;
  }

  void abort_videos(Episode& episode) {
    for (EncoderPool::Stream* stream : episode.videos) pool->abort(stream);
    episode.videos.clear();
  }

  [[noreturn]] void wait_for_failure() {
    std::unique_lock lock(mutex);
    progress.wait(lock, [&] { return failure != nullptr; });
    std::rethrow_exception(failure);
  }

  // Waits until every episode that is not running is settled.
  void flush() {
    std::unique_lock lock(mutex);
    progress.wait(lock, [&] { return unsettled == running_count() || failure; });
    if (failure) std::rethrow_exception(failure);
  }

  int running_count() const {
    return static_cast<int>(std::count_if(worlds.begin(), worlds.end(),
                                          [](const EpisodePtr& e) { return e != nullptr; }));
  }

  void post(Job job) {
    {
      const std::lock_guard lock(mutex);
      jobs.push_back(std::move(job));
    }
    work.notify_one();
  }

  // ---- the encoders' thread

  void video_done(const EpisodePtr& episode, const EncoderPool::Result& result) {
    if (!result.ok && !result.why.empty()) {
      fail(std::make_exception_ptr(RuntimeError(
          fmt::format("episode {} cannot be recorded: {}", episode->meta.episode, result.why))));
    }
    part_done(episode);
  }

  void part_done(const EpisodePtr& episode) {
    if (--episode->parts == 0) post({Job::kSettle, episode});
  }

  void fail(std::exception_ptr error) {
    {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::move(error);
    }
    progress.notify_all();
  }

  // ---- the writer thread

  void write_jobs() {
    while (true) {
      Job job;
      bool failed;
      {
        std::unique_lock lock(mutex);
        work.wait(lock, [&] { return stop || !jobs.empty(); });
        if (jobs.empty()) return;
        job = std::move(jobs.front());
        jobs.pop_front();
        failed = failure != nullptr;
      }
      try {
        run(job, failed);
      } catch (...) {
        fail(std::current_exception());
      }
      after(job);
    }
  }

  void run(Job& job, bool failed) {
    Episode& episode = *job.episode;
    const Clock::time_point start = Clock::now();
    switch (job.kind) {
      case Job::kOpen:
        if (!failed)
          episode.file = std::make_unique<EpisodeFile>(part_dir(episode) / kEpisodeFile, cfg, plan,
                                                       episode.meta);
        break;
      case Job::kChunk:
        if (!failed && episode.file) episode.file->write_chunk(job.stream, job.rows, job.chunk);
        break;
      case Job::kClose:
        if (!failed && episode.file && episode.fate == Fate::kKept)
          episode.file->finish(job.obs_scene, job.outcome);
        break;
      case Job::kSettle:
        settle(episode, failed);
        break;
    }
    (job.kind == Job::kSettle ? commit_s : write_s) += seconds_since(start);
  }

  void after(Job& job) {
    if (job.kind == Job::kClose) {
      job.episode->file.reset();
      part_done(job.episode);
    }
    {
      const std::lock_guard lock(mutex);
      if (job.kind == Job::kChunk && !job.chunk.empty())
        free_chunks[job.stream].push_back(std::move(job.chunk));
      if (job.kind == Job::kSettle) --unsettled;
    }
    progress.notify_all();
  }

  void settle(const Episode& episode, bool failed) {
    const std::int64_t number = episode.meta.episode;
    if (failed || episode.fate == Fate::kAbandoned) {
      house->abandon(number);
    } else if (episode.fate == Fate::kDiscarded) {
      house->discard(number, episode.why);
      house->publish_ready();
    } else {
      house->keep(number);
      house->publish_ready();
    }
    published_bytes = house->published_bytes();
  }
};

Recorder::Recorder(const RecordingCfg& cfg) : impl_(std::make_unique<Impl>(cfg)) {}
Recorder::~Recorder() = default;

void Recorder::begin_episode(int world, const EpisodeMeta& meta) { impl_->begin(world, meta); }
void Recorder::append(int world, const StepRow& row) { impl_->append(world, row); }
void Recorder::finish_episode(int world, std::string_view obs_scene, std::string_view outcome) {
  impl_->finish(world, obs_scene, outcome);
}
void Recorder::discard_episode(int world, std::string_view why) {
  impl_->running(world, "discard an episode");
  impl_->give_up(world, Fate::kDiscarded, why);
}
void Recorder::abandon_episode(int world) {
  impl_->running(world, "abandon an episode");
  impl_->give_up(world, Fate::kAbandoned, "");
}

bool Recorder::recording(int world) const {
  impl_->check_world(world);
  return impl_->worlds[world] != nullptr;
}

bool Recorder::decided(std::int64_t episode) const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->decisions.contains(episode);
}

int Recorder::kept() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->decisions.kept();
}

int Recorder::discarded() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->decisions.discarded();
}

bool Recorder::enough() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->house->ended() ||
         static_cast<int>(impl_->decisions.first(impl_->cfg.episodes, true).size()) >=
             impl_->cfg.episodes;
}

void Recorder::flush() { impl_->flush(); }

void Recorder::complete() {
  for (int w = 0; w < impl_->cfg.num_worlds; ++w) {
    if (impl_->worlds[w]) {
      throw ValueError(
          fmt::format("cannot complete the recording: world {} still records episode {}", w,
                      impl_->worlds[w]->meta.episode));
    }
  }
  impl_->flush();
  impl_->house->publish_all();
  impl_->published_bytes = impl_->house->published_bytes();
}

std::filesystem::path Recorder::house_dir() const { return impl_->house->dir(); }

RecordStats Recorder::stats() const {
  RecordStats s;
  s.rows = impl_->rows;
  s.frames = impl_->frames;
  std::size_t row = 0;
  for (const Sensor* sensor : impl_->cfg.sensors) row += sensor->bytes_per_world();
  s.raw_bytes = s.rows * static_cast<std::int64_t>(row);
  s.copy_s = impl_->copy_s;
  s.wait_s = impl_->wait_s;
  s.write_s = impl_->write_s;
  s.commit_s = impl_->commit_s;
  if (impl_->pool) s.encode_cpu_s = impl_->pool->cpu_s();
  s.published_bytes = impl_->published_bytes;
  return s;
}

std::size_t Recorder::bytes_per_world() const {
  std::size_t bytes = 0;
  for (int s = 0; s < impl_->streams; ++s) {
    bytes += (kBuffersPerWorld) * static_cast<std::size_t>(impl_->chunk_rows_of[s]) *
             impl_->row_bytes[s];
  }
  for (const VideoStream& video : impl_->plan.videos)
    bytes += impl_->cfg.video.queue_frames * video.frame_bytes();
  return bytes;
}

}  // namespace mjsense
