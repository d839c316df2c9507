// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/process_state.h"
#include "mjsense/record/recorder_impl.h"

namespace mjsense::record {
namespace {

void validate(const RecordingCfg& cfg) {
  const auto require = [](bool ok, const char* what, auto value, const char* expected) {
    if (!ok)
      throw ValueError(fmt::format("recording: {} is {}, expected {}", what, value, expected));
  };
  if (cfg.out_dir.empty()) throw ValueError("recording: no output directory was given");
  if (printable(cfg.out_dir.string()) != cfg.out_dir.string())
    throw ValueError(fmt::format("recording: the output directory '{}' contains control characters",
                                 printable(cfg.out_dir.string())));
  check_fields<FilesCfg>(cfg, "recording");
  require(cfg.num_worlds > 0, "num_worlds", cfg.num_worlds, "at least 1");
  require(cfg.first_attempt >= 0, "first_attempt", cfg.first_attempt, "0 or more");
  require(cfg.num_attempts >= 0, "num_attempts", cfg.num_attempts, "0 (any) or more");
  if (cfg.resume + cfg.append + cfg.overwrite > 1)
    throw ValueError("recording: choose one of resume, append and overwrite");
  if (cfg.append && cfg.first_attempt > 0)
    throw ValueError("recording: append determines first_attempt; leave it out");
  require(cfg.fps.num > 0 && cfg.fps.den > 0, "fps", fmt::format("{}/{}", cfg.fps.num, cfg.fps.den),
          "a positive fraction");
}

}  // namespace

Recorder::Impl::Impl(const RecordingCfg& cfg_) : cfg(cfg_) {
  validate(cfg);
  batches_of(cfg.episodes, cfg.batches);
  const std::filesystem::path dir = cfg.out_dir / fmt::format("house_{}", cfg.house);
  set_start(dir);
  plan = plan_recording(cfg);
  check_names();
  check_ffmpeg(cfg.video, plan.videos);
  if (cfg.overwrite) remove_recordings(dir);
  house = std::make_unique<RecordingFolder>(dir, plan.fingerprint, cfg.resume);
  if (!house->ended()) {
    if (!cfg.archive_name.empty()) house->store(cfg.archive_name, cfg.archive);
    house->publish_ready();
  }
  decisions = house->decisions();
  saved = decisions.kept();
  for (const ArrayStream& stream : plan.arrays) {
    row_bytes.push_back(stream.kept_bytes());
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
    pool = std::make_unique<EncoderPool>(
        cfg.video, cfg.fps, static_cast<int>(plan.videos.size()) * cfg.num_worlds, cfg.stop);
  }
  writer = std::thread([this] { write_jobs(); });
}

Recorder::Impl::~Impl() {
  for (int w = 0; w < cfg.num_worlds; ++w) {
    if (worlds[w]) give_up(w, Outcome::kAbandoned, "");
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

// Finds where a recording begins that continues others of the same folder.
void Recorder::Impl::set_start(const std::filesystem::path& dir) {
  if (!cfg.append && !cfg.resume) return;
  const RecordingStart start = cfg.append ? start_after(dir) : start_of_last(dir);
  if (start.batch == 0) return;
  cfg.first_attempt = start.attempt;
  cfg.first_batch = start.batch;
}

void Recorder::Impl::check_names() const {
  for (const VideoStream& video : plan.videos) {
    const std::string name = video_file(cfg.first_attempt, video.stem + video.extension);
    if (name.size() > kFileNameBytes) {
      throw ValueError(fmt::format(
          "sensor '{}': its video would be named '{}', {} bytes long; the maximum is {}",
          video.sensor->name(), name, name.size(), kFileNameBytes));
    }
  }
}

void Recorder::Impl::rethrow() const {
  const std::lock_guard lock(mutex);
  if (failure) std::rethrow_exception(failure);
}

Recorder::Impl::Episode& Recorder::Impl::running(int world, const char* action) const {
  check_world(world);
  if (!worlds[world])
    throw ValueError(
        fmt::format("cannot {}: no episode has been started in world {}", action, world));
  return *worlds[world];
}

void Recorder::Impl::check_world(int world) const {
  if (world < 0 || world >= cfg.num_worlds) {
    throw ValueError(fmt::format("recording: world {} does not exist, expected 0 to {}", world,
                                 cfg.num_worlds - 1));
  }
}

void Recorder::Impl::begin(int world, const EpisodeMeta& meta) {
  check_world(world);
  const auto episode = std::make_shared<Episode>();
  episode->meta = meta;
  episode->parts = 1;
  episode->chunks.resize(streams);
  episode->chunk_fill.assign(streams, 0);
  episode->histograms.resize(plan.videos.size());
  {
    const std::lock_guard lock(mutex);
    if (failure) std::rethrow_exception(failure);
    if (worlds[world]) {
      throw ValueError(
          fmt::format("world {} is still recording episode {}: finish or discard it first", world,
                      worlds[world]->meta.episode));
    }
    check_number(meta.episode);
    episode->folder = house->begin(meta.episode);
    worlds[world] = episode;
    ++unsettled;
  }
  post({Job::kOpen, episode});
  const Clock::time_point start = Clock::now();
  try {
    for (const VideoStream& video : plan.videos) open_video(episode, video);
  } catch (...) {
    give_up(world, Outcome::kAbandoned, "");
    throw;
  }
  wait_s += seconds_since(start);
}

void Recorder::Impl::check_number(std::int64_t number) const {
  if (house->ended())
    throw ValueError(
        fmt::format("'{}' is complete; append to it to add episodes", house->dir().string()));
  if (number < cfg.first_attempt) {
    throw ValueError(fmt::format("recording: episode {} is before the first one, {}", number,
                                 cfg.first_attempt));
  }
  if (decisions.contains(number))
    throw ValueError(fmt::format("recording: episode {} is already recorded or discarded", number));
  for (const EpisodePtr& other : worlds) {
    if (other && other->meta.episode == number) {
      throw ValueError(
          fmt::format("recording: episode {} is already running in another world", number));
    }
  }
}

void Recorder::Impl::open_video(const EpisodePtr& episode, const VideoStream& video) {
  ++episode->parts;
  try {
    episode->videos.push_back(pool->open(
        video, episode->folder, video.stem + video.extension,
        [this, episode](const EncoderPool::Result& result) { video_done(episode, result); }));
  } catch (...) {
    --episode->parts;
    throw;
  }
}

void Recorder::Impl::finish(int world, std::string_view obs_scene, std::string_view outcome,
                            std::vector<EpisodeArray> arrays) {
  Episode& episode = running(world, "finish an episode");
  rethrow();
  if (episode.refused) {
    throw ValueError(
        fmt::format("recording: episode {} was rejected because a text did not fit: discard it",
                    episode.meta.episode));
  }
  if (episode.rows == 0)
    throw ValueError(fmt::format("recording: episode {} has no steps", episode.meta.episode));
  if (!nlohmann::json::accept(obs_scene)) {
    throw ValueError(fmt::format("recording: obs_scene of episode {} is not JSON text: {:.80}",
                                 episode.meta.episode, obs_scene));
  }
  const EpisodePtr kept = worlds[world];
  for (int s = 0; s < streams; ++s) {
    if (kept->chunk_fill[s] > 0) hand_over(kept, s);
  }
  kept->outcome = Outcome::kKept;
  Job close{Job::kClose, kept};
  close.obs_scene = obs_scene;
  close.outcome = outcome;
  close.arrays = std::move(arrays);
  post(std::move(close));
  for (EncoderPool::Stream* stream : kept->videos) pool->close(stream);
  kept->videos.clear();
  leave(world, *kept);
}

void Recorder::Impl::carry_over(int world, EpisodeSource source) {
  running(world, "carry data over");
  rethrow();
  Job job{Job::kCarry, worlds[world]};
  job.source = std::move(source);
  post(std::move(job));
}

void Recorder::Impl::skip(std::int64_t number, std::string_view why) {
  const auto episode = std::make_shared<Episode>();
  episode->meta.episode = number;
  episode->outcome = Outcome::kDiscarded;
  episode->why = why;
  {
    const std::lock_guard lock(mutex);
    if (failure) std::rethrow_exception(failure);
    check_number(number);
    decisions.add(number, false);
    ++unsettled;
  }
  post({Job::kSettle, episode});
}

void Recorder::Impl::give_up(int world, Outcome outcome, std::string_view why) {
  const EpisodePtr episode = worlds[world];
  episode->outcome = outcome;
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

void Recorder::Impl::leave(int world, const Episode& episode) {
  const std::lock_guard lock(mutex);
  worlds[world].reset();
  if (episode.outcome != Outcome::kAbandoned)
    decisions.add(episode.meta.episode, episode.outcome == Outcome::kKept);
}

void Recorder::Impl::abort_videos(Episode& episode) {
  for (EncoderPool::Stream* stream : episode.videos) pool->abort(stream);
  episode.videos.clear();
}

void Recorder::Impl::wait_for_failure() {
  std::unique_lock lock(mutex);
  progress.wait(lock, [&] { return failure != nullptr; });
  std::rethrow_exception(failure);
}

void Recorder::Impl::flush() {
  std::unique_lock lock(mutex);
  progress.wait(lock, [&] { return unsettled == running_count() || failure; });
  if (failure) std::rethrow_exception(failure);
}

int Recorder::Impl::running_count() const {
  return static_cast<int>(std::count_if(worlds.begin(), worlds.end(),
                                        [](const EpisodePtr& e) { return e != nullptr; }));
}

void Recorder::Impl::post(Job job) {
  {
    const std::lock_guard lock(mutex);
    jobs.push_back(std::move(job));
  }
  work.notify_one();
}

Recorder::Recorder(const RecordingCfg& cfg) : impl_(std::make_unique<Impl>(cfg)) {
  add_owner(impl_.get());
}
Recorder::~Recorder() {
  // The threads do not exist in a forked process and cannot be joined.
  if (forget_owner(impl_.get())) static_cast<void>(impl_.release());
}

void Recorder::begin_episode(int world, const EpisodeMeta& meta) { impl_->begin(world, meta); }
void Recorder::append(int world, const StepRow& row) { impl_->append(world, row); }
void Recorder::finish_episode(int world, std::string_view obs_scene, std::string_view outcome,
                              std::vector<EpisodeArray> arrays) {
  impl_->finish(world, obs_scene, outcome, std::move(arrays));
}
void Recorder::carry_over(int world, EpisodeSource source) {
  impl_->carry_over(world, std::move(source));
}
void Recorder::skip_episode(std::int64_t episode, std::string_view why) {
  impl_->skip(episode, why);
}
void Recorder::discard_episode(int world, std::string_view why) {
  impl_->running(world, "discard an episode");
  impl_->give_up(world, Impl::Outcome::kDiscarded, why);
}
void Recorder::abandon_episode(int world) {
  impl_->running(world, "abandon an episode");
  impl_->give_up(world, Impl::Outcome::kAbandoned, "");
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

int Recorder::saved() const { return impl_->saved; }

std::int64_t Recorder::first_attempt() const { return impl_->cfg.first_attempt; }

std::vector<std::string> Recorder::damage() const { return impl_->house->damage(); }

int Recorder::discarded() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->decisions.discarded();
}

bool Recorder::has_all_episodes() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->house->ended() ||
         static_cast<int>(impl_->decisions.settled().size()) >= impl_->cfg.episodes;
}

void Recorder::flush() { impl_->flush(); }

void Recorder::complete() {
  for (int w = 0; w < impl_->cfg.num_worlds; ++w) {
    if (impl_->worlds[w]) {
      throw ValueError(
          fmt::format("cannot complete the recording: world {} is still recording episode {}", w,
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
    bytes += (Impl::kBuffersPerWorld) * static_cast<std::size_t>(impl_->chunk_rows_of[s]) *
             impl_->row_bytes[s];
  }
  for (const VideoStream& video : impl_->plan.videos)
    bytes += impl_->cfg.video.queue_frames * video.frame_bytes();
  return bytes;
}

}  // namespace mjsense::record
