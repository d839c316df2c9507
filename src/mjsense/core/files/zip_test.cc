// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/zip.h"

#include <gmock/gmock.h>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/unzip.h"

namespace mjsense {
namespace {

TEST(Zip, ContainsTheFiles) {
  std::map<std::string, std::string> files{
      {"model.xml", "<mujoco/>"}, {"assets/0.obj", std::string(100'000, 'v')}, {"empty", ""}};
  ZipWriter zip;
  for (const auto& [name, bytes] : files) zip.add(name, bytes);
  const std::string archive = zip.finish();
  EXPECT_LT(archive.size(), 1000u);
  EXPECT_EQ(unzip(archive), files);
}

TEST(Zip, IsTheSameForTheSameFiles) {
  const auto archive = [] {
    ZipWriter zip;
    zip.add("a", "text");
    return zip.finish();
  };
  EXPECT_EQ(archive(), archive());
}

TEST(Zip, RefusesNames) {
  ZipWriter zip;
  EXPECT_THROW(zip.add("", "text"), ValueError);
  EXPECT_THROW(zip.add(std::string(70'000, 'n'), "text"), ValueError);
}

}  // namespace
}  // namespace mjsense
