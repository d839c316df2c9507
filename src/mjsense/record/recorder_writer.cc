// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recorder_impl.h"
#include "mjsense/record/video_file.h"

namespace mjsense::record {

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
        episode.file =
            std::make_unique<EpisodeFile>(episode.folder, kEpisodeFile, cfg, plan, episode.meta);
      break;
    case Job::kChunk:
      if (!failed && episode.file) episode.file->write_chunk(job.stream, job.rows, job.chunk);
      break;
    case Job::kCarry:
      if (!failed && episode.file) episode.file->carry_over(job.source);
      break;
    case Job::kClose:
      if (!failed && episode.file && episode.outcome == Outcome::kKept) {
        episode.file->write_scene(job.obs_scene, job.outcome, episode.rows - 1);
        for (const EpisodeArray& array : job.arrays) episode.file->write_array(array);
        for (std::size_t v = 0; v < plan.videos.size(); ++v) {
          if (plan.videos[v].kind == VideoKind::kRgb)
            episode.file->write_histogram(plan.videos[v], episode.histograms[v]);
        }
      }
      break;
    case Job::kSettle:
      settle(episode, failed);
      break;
  }
  (job.kind == Job::kSettle ? commit_s : write_s) += seconds_since(start);
}

void Recorder::Impl::after(Job& job) {
  if (job.kind == Job::kClose) part_done(job.episode);
  {
    const std::lock_guard lock(mutex);
    if (job.kind == Job::kChunk && !job.chunk.empty())
      free_chunks[job.stream].push_back(std::move(job.chunk));
    if (job.kind == Job::kSettle) --unsettled;
  }
  progress.notify_all();
}

std::vector<EpisodeFile::VideoSum> Recorder::Impl::check_videos(const Episode& episode) const {
  std::vector<EpisodeFile::VideoSum> sums;
  for (const VideoStream& video : plan.videos) {
    const std::string name = video.stem + video.extension;
    const auto refuse = [&](const std::string& why) {
      throw RuntimeError(
          fmt::format("episode {} cannot be recorded: video '{}': ffmpeg reported success, but {}",
                      episode.meta.episode, video.key, why));
    };
    try {
      const Fd file = open_plain(episode.folder->fd(), name);
      const VideoFacts facts = read_video_facts(file.get());
      const auto fits = [](int got, int asked) { return got == asked || got == asked + asked % 2; };
      if (!facts.error.empty())
        refuse(fmt::format("'{}' is not a complete video: {}", name, facts.error));
      if (facts.codec != video.codec() || facts.container != video.container())
        refuse(fmt::format("'{}' contains {} in {}, expected {} in {}", name,
                           printable(facts.codec), facts.container, video.codec(),
                           video.container()));
      if (facts.frames != episode.rows)
        refuse(fmt::format("'{}' has {}, expected {}", name, counted(facts.frames, "frame"),
                           episode.rows));
      if (!fits(facts.width, video.width) || !fits(facts.height, video.height))
        refuse(fmt::format("'{}' is {} x {} pixels, expected {} x {}", name, facts.width,
                           facts.height, video.width, video.height));
      sums.push_back({checksum_of(file.get()), size_of(file)});
    } catch (const RuntimeError& e) {
      if (std::string_view(e.what()).starts_with("episode ")) throw;
      refuse(e.what());
    }
  }
  return sums;
}

void Recorder::Impl::settle(Episode& episode, bool failed) {
  const std::int64_t number = episode.meta.episode;
  if (failed || episode.outcome != Outcome::kKept) episode.file.reset();
  if (failed || episode.outcome == Outcome::kAbandoned) {
    house->abandon(number);
  } else if (episode.outcome == Outcome::kDiscarded) {
    house->discard(number, episode.why);
    house->publish_ready();
  } else {
    try {
      episode.file->finish(check_videos(episode));
      episode.file.reset();
    } catch (...) {
      episode.file.reset();
      house->abandon(number);
      throw;
    }
    house->keep(number, *episode.folder);
    saved = house->decisions().kept();
    house->publish_ready();
  }
  published_bytes = house->published_bytes();
}

}  // namespace mjsense::record
