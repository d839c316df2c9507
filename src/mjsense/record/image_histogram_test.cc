// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/image_histogram.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::record {
namespace {

using namespace testing;
using Counts = std::vector<std::uint64_t>;  // [3, 256]

// Counts every pixel of `rgb` whose row and column are multiples of `step`.
void count(std::span<const std::uint8_t> rgb, int width, int height, int step, Counts& counts) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (x % step != 0 || y % step != 0) continue;
      for (int c = 0; c < 3; ++c) ++counts[256 * c + rgb[3 * (y * width + x) + c]];
    }
  }
}

TEST(ImageHistogram, HasAtMost160RowsAndColumns) {
  EXPECT_EQ(ImageHistogram::step(1, 1), 1);
  EXPECT_EQ(ImageHistogram::step(160, 96), 1);
  EXPECT_EQ(ImageHistogram::step(161, 96), 2);
  EXPECT_EQ(ImageHistogram::step(640, 368), 4);
  EXPECT_EQ(ImageHistogram::step(368, 641), 5);
}

std::span<const std::uint8_t> image_of(FakeSuite& suite, int world) {
  const Field& field = suite.sensor("wrist_camera").fields()[0];
  return {reinterpret_cast<const std::uint8_t*>(field.data.row_data(world)),
          field.data.row_bytes()};
}

constexpr int kWidth = 331, kHeight = 45, kStep = 3, kEpisodes = 4;

// Records episodes of different lengths. Returns the counts of all images that were appended.
std::map<std::int64_t, Counts> record(const fs::path& out, int worlds) {
  std::map<std::int64_t, Counts> expected;
  FakeSuite suite({worlds, kWidth, kHeight, true, true});
  Recorder recorder(fake_recording(out, suite, worlds, kEpisodes));
  for (int first = 0; first < kEpisodes; first += worlds) {
    for (int w = 0; w < worlds; ++w) recorder.begin_episode(w, {first + w, 7});
    for (int t = 0; t < length_of(2, 5); ++t) {
      for (int w = 0; w < worlds; ++w) {
        const int length = length_of(first + w, 5);
        if (t >= length) continue;
        suite.fill(w, first + w, t, length);
        recorder.append(w, {});
        Counts& counts = expected[first + w];
        counts.resize(std::size_t{3} * 256);
        count(image_of(suite, w), kWidth, kHeight, kStep, counts);
      }
    }
    for (int w = 0; w < worlds; ++w) recorder.finish_episode(w, FakeSuite::obs_scene(first + w));
  }
  recorder.complete();
  return expected;
}

Counts stored(hid_t trajectory) {
  const hdf5::Id video = hdf5::open_dataset(trajectory, "obs/sensor_data/wrist_camera");
  Counts counts(std::size_t{3} * 256);
  const hdf5::Id attribute(H5Aopen(video, "histogram", H5P_DEFAULT), H5Aclose, "histogram");
  EXPECT_GE(H5Aread(attribute, H5T_NATIVE_UINT64, counts.data()), 0);
  return counts;
}

TEST(ImageHistogram, StoredOnesCountEveryFrameOfAnEpisode) {
  for (const int worlds : {1, 2}) {
    const TempDir out;
    const auto expected = record(out.path, worlds);
    const hdf5::H5Lock lock;
    const hdf5::Id file = hdf5::open_file(out.path / "house_0/trajectories_batch_1_of_1.h5");
    ASSERT_EQ(hdf5::children(file).size(), kEpisodes);
    for (const std::string& name : hdf5::children(file)) {
      const hdf5::Id trajectory = hdf5::open_group(file, name);
      EXPECT_EQ(stored(trajectory), expected.at(hdf5::int_attribute(trajectory, "episode", -1)));
      const hdf5::Id depth = hdf5::open_dataset(trajectory, "obs/sensor_data/wrist_camera_depth");
      EXPECT_FALSE(hdf5::has_attribute(depth, "histogram"));
    }
  }
}

}  // namespace
}  // namespace mjsense::record
