// SPDX-License-Identifier: Apache-2.0
// Benchmark of deflate.h compared with zlib, on 120,000 rows of 60 float32 as a recording has them:
// smooth joint motion with a little noise, and constants. The counter "ratio" is the compressed
// size, as a fraction.

#include <benchmark/benchmark.h>
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/core/files/deflate.h"

namespace mjsense {
namespace {

std::span<const std::uint8_t> rows() {
  static const std::vector<float> values = [] {
    std::vector<float> made;
    std::uint32_t x = 1;
    for (int row = 0; row < 120'000; ++row) {
      for (int joint = 0; joint < 60; ++joint) {
        x = x * 1664525 + 1013904223;
        const float noise = 1e-4f * static_cast<float>(x >> 8) * 0x1p-24f;
        made.push_back(joint % 3 == 2 ? static_cast<float>(joint)
                                      : std::sin(0.01f * static_cast<float>(row + joint)) + noise);
      }
    }
    return made;
  }();
  return {reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(float)};
}

// Calls `compress` for chunks of 128 KiB, as a recording does.
template <class F>
void chunks(benchmark::State& state, F compress) {
  constexpr std::size_t kChunk = 1 << 17;
  std::size_t packed = 0, count = 0;
  for (auto _ : state) {
    packed = count = 0;
    for (std::size_t at = 0; at + kChunk <= rows().size(); at += kChunk, count += kChunk)
      packed += compress(rows().subspan(at, kChunk));
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(count) * state.iterations());
  state.counters["ratio"] = static_cast<double>(packed) / static_cast<double>(count);
}

void compress_libdeflate(benchmark::State& state) {
  const int level = static_cast<int>(state.range(0));
  chunks(state, [&](auto chunk) { return deflated(chunk, level, DeflateFormat::kZlib).size(); });
}
void compress_zlib(benchmark::State& state) {
  std::vector<std::uint8_t> out(compressBound(1 << 17));
  chunks(state, [&](auto chunk) {
    uLongf size = out.size();
    compress2(out.data(), &size, chunk.data(), chunk.size(), static_cast<int>(state.range(0)));
    return size;
  });
}
BENCHMARK(compress_libdeflate)->Arg(1)->Arg(4)->Arg(6)->Unit(benchmark::kMillisecond);
BENCHMARK(compress_zlib)->Arg(1)->Arg(4)->Arg(6)->Unit(benchmark::kMillisecond);

void crc_libdeflate(benchmark::State& state) {
  chunks(state, [](auto chunk) { return crc32_of(0, chunk.data(), chunk.size()) & 1; });
}
void crc_zlib(benchmark::State& state) {
  chunks(state, [](auto chunk) { return crc32_z(0, chunk.data(), chunk.size()) & 1; });
}
BENCHMARK(crc_libdeflate)->Unit(benchmark::kMillisecond);
BENCHMARK(crc_zlib)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mjsense
