// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstring>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/record/depth_encoding.h"
#include "mjsense/record/recorder_impl.h"
#include "mjsense/record/yuv.h"

namespace mjsense::record {
namespace {

template <class T>
void fill_with_nan(std::uint8_t* to, std::size_t bytes) {
  constexpr T kNaN = std::numeric_limits<T>::quiet_NaN();
  for (std::size_t at = 0; at < bytes; at += sizeof kNaN) std::memcpy(to + at, &kNaN, sizeof kNaN);
}

void copy_row(const ArrayStream& stream, int world, std::uint8_t* to) {
  if (stream.text) return stream.text->copy(world, to);
  if (!stream.field) {
    *to = 1;
    return;
  }
  const std::byte* from = stream.field->data.row_data(world);
  const std::size_t maximum = stream.row_bytes();
  if (stream.present && stream.present->data.row_data(world)[0] == std::byte{0}) {
    return stream.spec.dtype == DType::kFloat32 ? fill_with_nan<float>(to, maximum)
                                                : fill_with_nan<double>(to, maximum);
  }
  // Only the text of a dict row is copied; the rest is zero in both buffers.
  const bool text = stream.spec.is_dict;
  std::memcpy(to, from, text ? strnlen(reinterpret_cast<const char*>(from), maximum) : maximum);
}

}  // namespace

void Recorder::Impl::append(int world, const StepRow& row) {
  Episode& episode = running(world, "append a step");
  rethrow();
  check_texts(world, episode);
  for (std::size_t v = 0; v < plan.videos.size(); ++v) {
    const Clock::time_point asked = Clock::now();
    const std::span<std::uint8_t> frame = pool->reserve(episode.videos[v]);
    wait_s += seconds_since(asked);
    if (frame.empty()) {
      abort_videos(episode);  // so that ffmpeg's error message is collected
      wait_for_failure();
    }
    const Clock::time_point start = Clock::now();
    copy_frame(plan.videos[v], world, frame, episode.histograms[v]);
    copy_s += seconds_since(start);
    pool->commit(episode.videos[v]);
  }
  const Clock::time_point start = Clock::now();
  const double waited = episode.waited_s;
  for (std::size_t s = 0; s < plan.arrays.size(); ++s) {
    const int stream = static_cast<int>(s);
    if (std::uint8_t* to = next_row(episode, stream)) copy_row(plan.arrays[s], world, to);
    end_row(episode, world, stream);
  }
  const bool fail = !row.success;
  const void* own[kOwnStreams] = {&row.reward, &row.success, &fail, &row.terminated,
                                  &row.truncated};
  for (int i = 0; i < kOwnStreams; ++i) {
    const int s = static_cast<int>(plan.arrays.size()) + i;
    std::memcpy(next_row(episode, s), own[i], row_bytes[s]);
    end_row(episode, world, s);
  }
  ++episode.rows;
  rows += 1;
  frames += static_cast<std::int64_t>(plan.videos.size());
  copy_s += seconds_since(start) - (episode.waited_s - waited);
}

void Recorder::Impl::check_texts(int world, Episode& episode) const {
  for (const ArrayStream& stream : plan.arrays) {
    if (!stream.field || !stream.spec.is_dict) continue;
    const char* text = reinterpret_cast<const char*>(stream.field->data.row_data(world));
    const std::size_t maximum = stream.field->data.row_bytes();
    const std::size_t size = strnlen(text, maximum);
    if (size < maximum || (size > 0 && (text[size - 1] == '}' || text[size - 1] == ']'))) continue;
    episode.refused = true;
    throw ValueError(
        fmt::format("sensor '{}': step {} of episode {}: its text does not fit str_max_len = {}; "
                    "the episode cannot be kept",
                    stream.sensor->name(), episode.rows, episode.meta.episode, maximum));
  }
}

void Recorder::Impl::copy_frame(const VideoStream& video, int world, std::span<std::uint8_t> frame,
                                ImageHistogram& histogram) const {
  const std::byte* from = video.field->data.row_data(world);
  const std::size_t pixels = static_cast<std::size_t>(video.width) * video.height;
  const std::span<const float> metres(reinterpret_cast<const float*>(from), pixels);
  const std::span<const std::uint8_t> rgb(reinterpret_cast<const std::uint8_t*>(from), 3 * pixels);
  switch (video.kind) {
    case VideoKind::kRgb:
      encode_yuv420(rgb, video.width, video.height, frame);
      histogram.add(rgb, video.width, video.height);
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

std::uint8_t* Recorder::Impl::next_row(Episode& episode, int s) {
  if (row_bytes[s] == 0) return nullptr;
  Buffer& chunk = episode.chunks[s];
  if (episode.chunk_fill[s] == 0 && chunk.empty()) chunk = take_buffer(episode, s);
  return chunk.data() + static_cast<std::size_t>(episode.chunk_fill[s]) * row_bytes[s];
}

void Recorder::Impl::end_row(Episode& episode, int world, int s) {
  if (++episode.chunk_fill[s] == chunk_rows_of[s]) hand_over(worlds[world], s);
}

Recorder::Impl::Buffer Recorder::Impl::take_buffer(Episode& episode, int s) {
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

void Recorder::Impl::hand_over(const EpisodePtr& episode, int s) {
  Job job{Job::kChunk, episode, s, episode->chunk_fill[s], std::move(episode->chunks[s])};
  episode->chunks[s] = {};
  episode->chunk_fill[s] = 0;
  post(std::move(job));
}

}  // namespace mjsense::record
