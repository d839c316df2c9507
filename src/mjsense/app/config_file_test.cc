// SPDX-License-Identifier: Apache-2.0
// Every key of an experiment file sets the option of its name and no other.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "mjsense/app/field_options.h"
#include "mjsense/app/progress.h"
#include "mjsense/app/record_command.h"
#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

RecordOptions read(const std::string& toml) {
  const mjsense::testing::TempDir folder;
  const std::string name = folder.file("experiment.toml");
  std::ofstream(name) << toml;
  RecordOptions options;
  read_toml(name, struct_of<tasks::rollout::RecordJobCfg>(), &options.job);
  return options;
}

// The options that a file can set, as one text; options that it does not set keep their value.
std::string text(const RecordOptions& options) {
  const tasks::rollout::RecordJobCfg& job = options.job;
  const tasks::rollout::RolloutCfg& r = job.rollout;
  std::string cameras = r.cameras ? "" : "all";
  for (const std::string& name : r.cameras.value_or(std::vector<std::string>{}))
    cameras += name + ",";
  return fmt::format(
      "task={} robot={} policy={} episodes={} max_attempts={} worlds={} threads={} seed={} out={} "
      "cameras={} width={} "
      "height={} depth={} samples={} shadows={} horizon={} noise={} keep={} house={} batches={} "
      "gzip={} crf={} preset={} "
      "ffmpeg={} red_green={}",
      r.task, r.robot, r.policy, job.episodes, job.max_attempts, r.num_worlds, r.threads, r.seed,
      job.out.string(), cameras, r.width.value_or(0), r.height.value_or(0), r.depth, r.samples,
      r.shadows, r.horizon.value_or(0), r.action_noise, job.keep_failures, job.house, job.batches,
      job.gzip, job.video.crf, job.video.preset, job.video.ffmpeg, job.video.molmospaces_depth);
}

// Replaces the word that begins with `key`.
std::string with(std::string line, const std::string& key, const std::string& value) {
  const std::size_t at = line.find(" " + key) == std::string::npos ? 0 : line.find(" " + key) + 1;
  EXPECT_EQ(line.substr(at, key.size()), key);
  return line.replace(at, std::min(line.find(' ', at), line.size()) - at, key + value);
}

TEST(ConfigFile, EveryKeySetsItsOptionOnly) {
  const std::string before = text(RecordOptions());
  const struct {
    const char *toml, *key, *value;
  } keys[] = {
      {"task = 'pour'", "task=", "pour"},
      {"robot = 'rum'", "robot=", "rum"},
      {"policy = 'mine'", "policy=", "mine"},
      {"episodes = 71", "episodes=", "71"},
      {"max_attempts = 72", "max_attempts=", "72"},
      {"worlds = 73", "worlds=", "73"},
      {"threads = 74", "threads=", "74"},
      {"seed = 75", "seed=", "75"},
      {"out = 'there'", "out=", "there"},
      {"cameras = ['a', 'b']", "cameras=", "a,b,"},
      {"cameras = 'c,d'", "cameras=", "c,d,"},
      {"cameras = 'none'", "cameras=", ""},
      {"depth = true", "depth=", "true"},
      {"samples = 5", "samples=", "5"},
      {"no_shadows = true", "shadows=", "false"},
      {"no_shadows = false", "shadows=", "true"},
      {"horizon = 76", "horizon=", "76"},
      {"no_noise = true", "noise=", "false"},
      {"no_noise = false", "noise=", "true"},
      {"keep_failures = true", "keep=", "true"},
      {"house = 77", "house=", "77"},
      {"batches = 3", "batches=", "3"},
      {"gzip = 8", "gzip=", "8"},
      {"crf = 31", "crf=", "31"},
      {"preset = 'slow'", "preset=", "slow"},
      {"ffmpeg = '/bin/f'", "ffmpeg=", "/bin/f"},
      {"molmospaces_depth = true", "red_green=", "true"},
  };
  for (const auto& [toml, key, value] : keys)
    EXPECT_EQ(text(read(toml)), with(before, key, value)) << toml;
  EXPECT_EQ(text(read("size = '64x48'")), with(with(before, "width=", "64"), "height=", "48"));
  EXPECT_EQ(text(read("")), before);
  const RecordOptions all = read("seed = 1\nepisodes = 2\nno_noise = true\n");
  EXPECT_EQ(all.job.rollout.seed, 1u);
  EXPECT_EQ(all.job.episodes, 2);
  EXPECT_FALSE(all.job.rollout.action_noise);
}

TEST(ConfigFile, WrongKeysAndTypesAreErrors) {
  const auto fault = [](const std::string& toml) -> std::string {
    return error_of([&] { read(toml); });
  };
  EXPECT_THAT(fault("seed = 1\nsamles = 2\n"),
              HasSubstr(":2: no key named 'samles'; did you mean 'samples'?"));
  for (const char* wrong : {"episodes = 1.5", "depth = 1", "task = true", "cameras = [1]",
                            "cameras = 3", "size = 64", "no_noise = 'yes'"}) {
    EXPECT_THAT(fault(wrong), HasSubstr("has the wrong type")) << wrong;
  }
  EXPECT_THAT(fault("seed = 1\nsize = '64'"), HasSubstr(":2: size '64': expected WIDTHxHEIGHT"));
  EXPECT_THAT(fault("seed = 1\ncameras = 'a,,b'"),
              HasSubstr(":2: cameras is 'a,,b': must be a list"));
}

// toml++ 3.3 assumes that there are no letters beyond ASCII outside of strings. This tests all of
// them: Unicode spaces are spaces, and no other letter can be part of a key.
TEST(ConfigFile, LettersBeyondAscii) {
  const std::set<int> spaces = {0xA0,   0x1680, 0x180E, 0x202F, 0x205F, 0x2060,
                                0x3000, 0x85,   0x2028, 0x2029, 0xFEFF};
  for (int c = 0x80; c < 0x10000; ++c) {
    if (c >= 0xD800 && c < 0xE000) continue;
    std::string letter;
    if (c >= 0x800) letter += static_cast<char>(0xE0 | c >> 12);
    letter += static_cast<char>(c >= 0x800 ? 0x80 | (c >> 6 & 0x3F) : 0xC0 | c >> 6);
    letter += static_cast<char>(0x80 | (c & 0x3F));
    const bool space = spaces.contains(c) || (c >= 0x2000 && c <= 0x200B);
    tasks::rollout::RecordJobCfg job;
    const auto parse = [&] {
      read_toml_text("seed = 1\n" + letter + "task = 'place'", "x",
                     struct_of<tasks::rollout::RecordJobCfg>(), &job);
    };
    if (space) {
      try {
        parse();
      } catch (const ValueError&) {
      }
    } else {
      EXPECT_THROW(parse(), ValueError) << c;
      EXPECT_EQ(job.rollout.task, tasks::rollout::RecordJobCfg().rollout.task) << c;
    }
  }
}

// toml++ 3.3 asserts that some of these cannot occur.
TEST(ConfigFile, InvalidHeadersAreErrors) {
  for (const std::string header :
       {"+a",   "[+a",    "=", "#",  ".",        ".a",  "a.", "a.+", "a..b",
        ",",    "{",      "'", "\"", "''' a'''", " ",   "\n", "\r",  "\x01",
        "\x7f", "\u00e9", "[", "[[", "a",        "a b", "[a]"}) {
    tasks::rollout::RecordJobCfg job;
    EXPECT_THROW(read_toml_text("seed = 1\n[" + header, "x",
                                struct_of<tasks::rollout::RecordJobCfg>(), &job),
                 ValueError)
        << header;
  }
}

TEST(Options, Sizes) {
  tasks::rollout::RolloutCfg rollout;
  read_size(struct_of<tasks::rollout::RolloutCfg>(), &rollout, "640x368");
  EXPECT_EQ(rollout.width, 640);
  EXPECT_EQ(rollout.height, 368);
}

TEST(Texts, FormatTimesAndSizes) {
  EXPECT_EQ(clock_text(61.4), "1:01");
  EXPECT_EQ(clock_text(3 * 3600 + 59), "3:00:59");
  EXPECT_EQ(bytes_text(999), "999 B");
  EXPECT_EQ(bytes_text(1000), "1.0 kB");
  EXPECT_EQ(bytes_text(1.5e6), "1.5 MB");
  EXPECT_EQ(bytes_text(123456789), "123 MB");
}

}  // namespace
}  // namespace mjsense::app
