// SPDX-License-Identifier: Apache-2.0
// The names of model archives, of this and of earlier versions, contain their checksums.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "mjsense/record/checksum.h"
#include "mjsense/record/sha256.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::replay {
namespace {

using namespace record;
using namespace testing;

TEST(ArchiveName, VerifyFindsDamageByTheName) {
  const std::string bytes = "bytes of an archive";
  Sha256 sha;
  sha.add(bytes.data(), bytes.size());
  Checksum crc;
  crc.add(bytes.data(), bytes.size());
  for (const std::string& name :
       {archive_name(sha.text()), fmt::format("model_{}.zip", crc.text())}) {
    TempDir dir;
    write_recording(dir.path, 1, {.worlds = 1}, false, [&](RecordingCfg& cfg) {
      cfg.archive_name = name;
      cfg.archive = bytes;
    });
    EXPECT_TRUE(verify(dir.path).ok()) << name << verify(dir.path).text();
    const std::filesystem::path path = dir.path / "house_0" / name;
    std::ofstream(path) << "Bytes of an archive";
    EXPECT_FALSE(verify(dir.path).ok()) << name;
  }
}

}  // namespace
}  // namespace mjsense::replay
