// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/regular_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "mjsense/core/error.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/memory_limit.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string refused(const std::filesystem::path& folder, std::string_view name) {
  try {
    const Fd file = open_plain(folder, name);
    return "";
  } catch (const RuntimeError& e) {
    return e.what();
  }
}

TEST(PlainFile, OpensRegularFilesInTheFolderOnly) {
  testing::TempDir dir;
  std::ofstream(dir.path / "video.mp4") << "x";
  std::filesystem::create_symlink("/etc/passwd", dir.path / "link");
  std::filesystem::create_directory(dir.path / "folder");
  mkfifo((dir.path / "pipe").c_str(), 0600);
  EXPECT_EQ(refused(dir.path, "video.mp4"), "");
  EXPECT_THAT(refused(dir.path, "link"), HasSubstr("is a symbolic link, which is not followed"));
  EXPECT_THAT(refused(dir.path, "folder"), HasSubstr("is a folder, expected a file"));
  EXPECT_THAT(refused(dir.path, "pipe"), HasSubstr("is a pipe, expected a file"));
  EXPECT_THAT(refused(dir.path, "none"), HasSubstr("does not exist"));
  for (const std::string& name :
       {std::string("../x"), std::string("/etc/passwd"), std::string("folder/x"), std::string("."),
        std::string(".."), std::string(""), std::string("a\nb"), std::string("a\0b", 3),
        std::string(256, 'x')}) {
    EXPECT_THAT(refused(dir.path, name), HasSubstr("is not a plain file name")) << name;
  }
}

// A checksum of a terabyte of holes would take minutes.
TEST(PlainFile, RejectsSparseFiles) {
  testing::TempDir dir;
  std::ofstream(dir.path / "video.mp4") << "x";
  std::filesystem::resize_file(dir.path / "video.mp4", std::uintmax_t{1} << 40);
  EXPECT_THAT(refused(dir.path, "video.mp4"),
              HasSubstr("declares 1099511627776 bytes but stores "));
  std::filesystem::resize_file(dir.path / "video.mp4", std::uintmax_t{1} << 30);
  EXPECT_EQ(refused(dir.path, "video.mp4"), "");
}

TEST(PlainFile, ReadsUserTextFiles) {
  testing::TempDir dir;
  const auto read = [](const std::string& path) -> std::string {
    try {
      return read_text_file(path);
    } catch (const ValueError& e) {
      return e.what();
    }
  };
  std::ofstream(dir.file("a.toml")) << "a = 1";
  std::filesystem::create_symlink("a.toml", dir.path / "link");
  mkfifo(dir.file("pipe").c_str(), 0600);
  std::ofstream(dir.file("large")) << "x";
  std::filesystem::resize_file(dir.path / "large", (1 << 24) + 1);
  EXPECT_EQ(read(dir.file("a.toml")), "a = 1");
  EXPECT_EQ(read(dir.file("link")), "a = 1");
  EXPECT_THAT(read(dir.file("none")), EndsWith("none: no such file"));
  EXPECT_THAT(read(dir.file("a.toml") + '\0'), EndsWith("no such file"));
  EXPECT_THAT(read(dir.file("pipe")), EndsWith("is a pipe, expected a file"));
  EXPECT_THAT(read("/dev/zero"), EndsWith("is a device, expected a file"));
  EXPECT_THAT(read(dir.path), EndsWith("is a folder, expected a file"));
  EXPECT_THAT(read(dir.file("large")), EndsWith("has more than 16 MiB"));
  // An empty text instead of an error would be taken for an empty experiment.
  EXPECT_THAT(read("/proc/self/mem"), EndsWith("cannot be read: Input/output error"));
}

TEST(PlainFile, WritesAtomically) {
  testing::TempDir dir;
  const std::filesystem::path mine = dir.path / "mine", out = dir.path / "out";
  std::ofstream(mine) << "mine";
  for (int i = 1; i < 50; ++i)  // planted by an attacker
    std::filesystem::create_symlink(mine, fmt::format("{}.{}-{}.part", out.string(), getpid(), i));
  const std::string text = "text";
  write_file(out, {std::as_bytes(std::span(text)), std::as_bytes(std::span(text))});
  EXPECT_EQ(std::filesystem::file_size(out), 8u);
  EXPECT_EQ(std::filesystem::file_size(mine), 4u);
  EXPECT_FALSE(std::filesystem::is_symlink(out));
  EXPECT_THAT(error_of<RuntimeError>([&] { write_file(dir.path / "no" / "folder", {}); }),
              StartsWith("cannot write '"));
}

TEST(PlainFile, ConcurrentWritersDoNotInterfere) {
  testing::TempDir dir;
  const std::filesystem::path out = dir.path / "out";
  const auto write = [&](char letter) {
    const std::string text(100'000, letter);
    for (int i = 0; i < 200; ++i) {
      write_file(out, {std::as_bytes(std::span(text))});
      const std::string found = read_text_file(out);
      EXPECT_EQ(found, std::string(found.size(), found[0]));
      EXPECT_EQ(found.size(), text.size());
    }
  };
  std::thread other(write, 'a');
  write('b');
  other.join();
}

TEST(PlainFile, PrintableText) {
  EXPECT_EQ(printable("wrist_camera µ 日"), "wrist_camera µ 日");
  EXPECT_EQ(printable("\x1b[31mred\x1b[0m\n"), "?[31mred?[0m?");
  EXPECT_EQ(printable("\xff\xfe.mp4"), "??.mp4");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "??31m");                           // the one-byte form (CSI) of escape and bracket
  EXPECT_EQ(printable("\xed\xa0\x80"), "???");  // half of a surrogate pair
  EXPECT_EQ(printable("cut \xe6\x97"), "cut ??");
  EXPECT_EQ(printable("gpj\u202e.exe\u2066 \u2028"), "gpj???.exe??? ???");
  EXPECT_EQ(printable("\u2027\u202f\u2065"), "\u2027\u202f\u2065");
  EXPECT_EQ(printable_lines("a\x1b\n\nb\r\n"), "a?\n\nb?\n");
  EXPECT_EQ(printable_lines(""), "");
}

// If the system refuses to start threads, that is an error. Threads that were started are ended.
TEST(ThreadPool, FailureToStartThreadsThrows) {
  EXPECT_THROW(ThreadPool(1'000'000), ValueError);
  testing::with_address_space(rlim_t{3} << 30, [] {  // each thread reserves 8 MiB of it
    alarm(20);
    try {
      const ThreadPool pool(4000);
      FAIL() << "4000 threads in 3 GiB";
    } catch (const RuntimeError& e) {
      EXPECT_NE(std::string(e.what()).find("use fewer threads"), std::string::npos) << e.what();
    }
  });
}

// In the child of a fork the threads do not exist. The destructor must not wait for them.
TEST(ThreadPool, DestructionInAForkedChild) {
  auto pool = std::make_unique<ThreadPool>(3);
  pool->run(8, [](int, int) {});
  const pid_t pid = fork();
  if (pid == 0) {
    alarm(20);
    pool.reset();
    int sum = 0;
    ThreadPool(1).run(3, [&](int item, int) { sum += item; });
    _exit(sum == 3 ? 0 : 1);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

}  // namespace
}  // namespace mjsense
