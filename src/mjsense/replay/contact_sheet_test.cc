// SPDX-License-Identifier: Apache-2.0
// Checks contact sheets by their pixels: tiles are located by their positions, and text lines are
// read.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/testing/png.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/replay/bitmap_font.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::replay {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::SizeIs;
using Rgb = std::array<int, 3>;

constexpr int kEdge = 4, kLine = kTextHeight + 4;  // pixels, of the sheet's layout
constexpr Rgb kGround = {24, 24, 24};

// Records `episodes` episodes with images of 32 x 24 pixels (a red ball that moves 2 pixels to the
// right per frame) and depth.
void record_ball(const fs::path& out, int episodes) {
  record::FakeSuite suite({1, 32, 24, true, true});
  record::Recorder recorder(fake_recording(out, suite, 1, episodes));
  record_all(recorder, suite, {.worlds = 1});
}

struct Band {  // range of rows or columns
  int begin, end;
};

class Sheet {
 public:
  explicit Sheet(const fs::path& png) {
    const std::string bytes = read_file(png);
    DecodedPng picture =
        decode_png({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
    width_ = picture.width;
    height_ = picture.height;
    EXPECT_EQ(picture.channels, 3);
    rgb_ = std::move(picture.pixels);
  }
  Rgb at(int x, int y) const {
    const std::uint8_t* p = &rgb_[3 * (static_cast<std::size_t>(y) * width_ + x)];
    return {p[0], p[1], p[2]};
  }
  // Rows of tiles: ranges in which the left edge is not background, longer than a letter is high.
  std::vector<Band> strips() const {
    return bands(height_, [&](int y) { return at(kEdge, y) != kGround; });
  }
  std::vector<Band> tiles(Band strip) const {
    return bands(width_, [&](int x) { return at(x, strip.begin) != kGround; });
  }
  // reads(): whether the line at `y` begins with `text` and, unless `more`, contains nothing else.
  // ends(): whether the line shows `text` right before `end`.
  bool reads(int y, std::string_view text, bool more = false) const {
    return reads(kEdge, y, text, more ? kEdge + label_width(text) : width_);
  }
  bool ends(int y, int end, std::string_view text) const {
    return reads(end - label_width(text), y, text, end);
  }
  bool reads(int begin, int y, std::string_view text, int end) const {
    std::vector<std::uint8_t> line(std::size_t{3} * width_ * kTextHeight, 0);
    draw_text(line, width_, begin, 0, text);
    for (int row = 0; row < kTextHeight; ++row)
      for (int x = begin; x < end; ++x)
        if ((line[3 * (static_cast<std::size_t>(row) * width_ + x)] > 0) !=
            (at(x, y + row) == Rgb{225, 225, 225}))
          return false;
    return true;
  }

 private:
  template <class Inside>
  static std::vector<Band> bands(int size, Inside inside) {
    std::vector<Band> found;
    for (int i = 0, begin = 0; i <= size; ++i) {
      if (i < size && inside(i)) continue;
      if (i - begin > 2 * kTextHeight) found.push_back({begin, i});
      begin = i + 1;
    }
    return found;
  }

  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> rgb_;
};

// Index of the frame that a tile shows, computed from the position of its ball.
int frame_of(const Sheet& sheet, Band strip, Band tile) {
  double sum = 0;
  int red = 0;
  for (int y = strip.begin; y < strip.end; ++y)
    for (int x = tile.begin; x < tile.end; ++x) {
      const Rgb c = sheet.at(x, y);
      if (c[0] < 190 || c[1] > 100) continue;
      sum += x + 0.5 - tile.begin;
      ++red;
    }
  EXPECT_GT(red, 100);
  const double column = sum / red * 32 / (tile.end - tile.begin);
  return static_cast<int>(std::lround((column - 8.5) / 2));
}

TEST(ContactSheet, ShowsEpisodesFromFirstToLastFrame) {
  TempDir dir;
  record_ball(dir.path, 3);  // episodes of 6, 7 and 8 frames
  const fs::path png = dir.path / "sheet.png";
  EXPECT_EQ(contact_sheet(dir.path, png, 2, 4), "2 of 3 episodes");
  const Sheet sheet(png);
  EXPECT_TRUE(sheet.reads(kEdge, "2 of 3 episodes"));
  const std::vector<Band> strips = sheet.strips();
  ASSERT_THAT(strips, SizeIs(4));  // rgb and depth of two episodes
  const auto frames = [&](Band strip) {
    std::vector<int> n;
    for (const Band& tile : sheet.tiles(strip)) n.push_back(frame_of(sheet, strip, tile));
    return n;
  };
  EXPECT_THAT(frames(strips[0]), ElementsAre(0, 1, 3, 5));
  EXPECT_THAT(frames(strips[2]), ElementsAre(0, 2, 4, 6));
  for (int e = 0; e < 2; ++e) {
    const int top = strips[2 * e].begin;
    EXPECT_TRUE(
        sheet.reads(top - kLine, "wrist_camera, " + std::to_string(6 + e) + " frames", true));
    EXPECT_TRUE(sheet.reads(
        top - 2 * kLine, fmt::format("house_0/trajectories_batch_1_of_1.h5  traj_{0}  Pick up the "
                                     "cup {0}: success",
                                     e)));
    const std::vector<Band> tiles = sheet.tiles(strips[2 * e]);
    EXPECT_TRUE(sheet.ends(top - kLine, tiles[2].end, std::to_string(3 + e)));
    EXPECT_TRUE(sheet.ends(top - kLine, tiles[3].end, std::to_string(5 + e)));
  }
  // If there are fewer frames than columns, each frame is shown once.
  contact_sheet(dir.path, png, 1, 20);
  const Sheet wide(png);
  EXPECT_THAT(frames(strips[0]), SizeIs(4));
  ASSERT_THAT(wide.strips(), SizeIs(2));
  EXPECT_THAT(wide.tiles(wide.strips()[0]), SizeIs(6));
  contact_sheet(dir.path, png, 3, 1);
  EXPECT_THAT(Sheet(png).strips(), SizeIs(6));
}

// FakeSuite::depth increases along x and with time. The upper left corner has no depth, and the
// upper right corner is infinitely far.
TEST(ContactSheet, DepthIsColouredFromNearToFar) {
  TempDir dir;
  record_ball(dir.path, 1);
  const fs::path png = dir.path / "sheet.png";
  contact_sheet(dir.path, png, 1, 6);
  const Sheet sheet(png);
  const std::vector<Band> strips = sheet.strips();
  ASSERT_THAT(strips, SizeIs(2));
  const int top = strips[1].begin;
  const std::vector<Band> tiles = sheet.tiles(strips[1]);
  ASSERT_THAT(tiles, SizeIs(6));
  double near = 1e9, far = 0;
  for (int t = 0; t < 6; ++t)
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 32; ++x) {
        const double z = record::FakeSuite::depth(x, y, t);
        if (z <= 0 || (x == 31 && y == 0)) continue;
        near = std::min(near, z);
        far = std::max(far, z);
      }
  EXPECT_TRUE(sheet.reads(top - kLine,
                          fmt::format("wrist_camera_depth, 6 frames, {:.2f} m (yellow)"
                                      " to {:.2f} m (blue)",
                                      near, far),
                          true));
  constexpr Rgb kNothing = {0, 0, 0}, kFarthest = {20, 20, 60}, kNearest = {250, 220, 90};
  int nearest = 0, farthest = 0;
  std::set<Rgb> colours;
  for (const Band& tile : tiles) {
    EXPECT_EQ(sheet.at(tile.begin, top), kNothing);
    EXPECT_EQ(sheet.at(tile.end - 1, top), kFarthest);
    for (int y = top + 3; y < strips[1].end; ++y)
      for (int x = tile.begin; x < tile.end; ++x) {
        nearest += sheet.at(x, y) == kNearest;
        farthest += sheet.at(x, y) == kFarthest;
        colours.insert(sheet.at(x, y));
      }
  }
  EXPECT_GT(nearest, 0);
  EXPECT_GT(farthest, 0);
  EXPECT_GT(colours.size(), 50u);
}

TEST(ContactSheet, ErrorsAreReported) {
  TempDir dir;
  write_recording(dir.path, 1, {.worlds = 1});
  const fs::path png = dir.path / "sheet.png";
  EXPECT_THAT(error_of([&] { contact_sheet(dir.path, png); }),
              ::testing::HasSubstr("contains no videos"));
  EXPECT_THAT(error_of([&] { contact_sheet(dir.path, png, 0); }),
              ::testing::HasSubstr("0 episodes"));
  EXPECT_FALSE(fs::exists(png));
}

}  // namespace
}  // namespace mjsense::replay
