// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/record/recorder_impl.h"

namespace mjsense {

void Recorder::Impl::video_done(const EpisodePtr& episode, const EncoderPool::Result& result) {
  if (!result.ok && !result.why.empty()) {
    fail(std::make_exception_ptr(RuntimeError(
        fmt::format("episode {} cannot be recorded: {}", episode->meta.episode, result.why))));
  }
  part_done(episode);
}

void Recorder::Impl::part_done(const EpisodePtr& episode) {
  if (--episode->parts == 0) post({Job::kSettle, episode});
}

void Recorder::Impl::fail(std::exception_ptr error) {
  {
    const std::lock_guard lock(mutex);
    if (!failure) failure = std::move(error);
  }
  progress.notify_all();
}

void Recorder::Impl::write_jobs() {
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

void Recorder::Impl::run(Job& job, bool failed) {
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

void Recorder::Impl::after(Job& job) {
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

void Recorder::Impl::settle(const Episode& episode, bool failed) {
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

}  // namespace mjsense
