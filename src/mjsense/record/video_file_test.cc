// SPDX-License-Identifier: Apache-2.0
// Frame counts of video containers without ffmpeg: complete, truncated and random files.
#include "mjsense/record/video_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::record {
namespace {

using namespace testing;

void write(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

VideoFacts facts_of(const fs::path& path) {
  const Fd file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  return read_video_facts(file.get());
}

class Containers : public ::testing::Test {
 protected:
  void SetUp() override {
    write_recording(dir.path, 1, {.worlds = 1}, true);
    for (const std::string& name : tree(dir.path)) {
      if (!name.ends_with(".h5")) videos.push_back(dir.path / name);
    }
    ASSERT_EQ(videos.size(), 2u);  // MP4 and Matroska
  }
  TempDir dir;
  std::vector<fs::path> videos;
};

TEST_F(Containers, FramesAreCounted) {
  for (const fs::path& video : videos) {
    const VideoFacts facts = facts_of(video);
    EXPECT_EQ(facts.error, "") << video;
    EXPECT_EQ(facts.frames, 6);
    EXPECT_EQ(facts.width, 16);
    EXPECT_EQ(facts.height, 12);
    EXPECT_EQ(facts.codec, video.extension() == ".mkv" ? "ffv1" : "h264");
    EXPECT_EQ(facts.container, video.extension() == ".mkv" ? "Matroska" : "MP4");
  }
}

TEST_F(Containers, TruncatedFilesAreIncomplete) {
  const fs::path part = dir.path / "part";
  for (const fs::path& video : videos) {
    const std::string bytes = read_file(video);
    for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 200) {
      write(part, bytes.substr(0, size));
      const VideoFacts facts = facts_of(part);
      EXPECT_TRUE(!facts.error.empty() || facts.frames != 6) << video << size;
    }
  }
}

// Random bytes must not crash or hang the reader (the sanitizers check that).
TEST_F(Containers, RandomBytesAreRejected) {
  const fs::path part = dir.path / "part";
  std::mt19937 rng(5);
  for (const fs::path& video : videos) {
    const std::string bytes = read_file(video);
    for (int n = 0; n < 1500; ++n) {
      std::string mutant = bytes;
      for (unsigned k = 0; k <= rng() % 8; ++k) {
        const std::size_t at = rng() % mutant.size();
        for (std::size_t i = at; i < std::min(mutant.size(), at + (rng() % 2 ? 1 : 4)); ++i)
          mutant[i] = static_cast<char>(rng() % 3 ? rng() : 0xFF);
      }
      write(part, mutant);
      EXPECT_GE(facts_of(part).frames, 0);
    }
  }
}

TEST(Checksum, EqualsZlib) {
  Checksum sum;
  sum.add("12345", 5);
  sum.add("6789", 4);
  EXPECT_EQ(sum.text(), "cbf43926");  // check value of CRC-32
}

TEST(Checksum, SealIsAppendedToTheFile) {
  TempDir dir;
  const fs::path path = dir.path / "file";
  const auto seal = [&] { return check_seal(Fd(open(path.c_str(), O_RDONLY | O_CLOEXEC)).get()); };
  write(path, "some bytes");
  EXPECT_EQ(seal(), Seal::kNone);
  seal_file(Folder::open(path.parent_path()), path.filename());
  EXPECT_EQ(seal(), Seal::kValid);
  const std::string whole = read_file(path);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = whole;
      damaged[i] = static_cast<char>(damaged[i] ^ 1 << bit);
      write(path, damaged);
      EXPECT_EQ(seal(), Seal::kCorrupt) << i << " " << bit;
    }
  }
}

}  // namespace
}  // namespace mjsense::record
