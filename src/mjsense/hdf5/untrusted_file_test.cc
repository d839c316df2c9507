// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/untrusted_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense::hdf5 {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Guard : public ::testing::Test {
 protected:
  // Creates a dataset of bytes.
  Id bytes(const std::string& name, const std::vector<hsize_t>& size, const Id& properties) {
    const Id space(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose,
                   "space");
    return {H5Dcreate2(file_, name.c_str(), H5T_STD_U8LE, space, link_properties(), properties,
                       H5P_DEFAULT),
            H5Dclose, name};
  }
  Id bytes(const std::string& name) { return bytes(name, {3}, dataset_properties()); }
  std::string storage(const Id& dataset) {
    return error_of<RuntimeError>([&] { check_storage(dataset, "x"); });
  }
  std::string walk() {
    return error_of<RuntimeError>([&] { each_dataset(file_, [](const std::string&) {}); });
  }

  H5Lock lock_;
  mjsense::testing::TempDir dir_;
  Id file_ = create_file(dir_.file("x.h5"));
};

TEST_F(Guard, DatasetsAreVisitedInOrder) {
  bytes("b");
  bytes("a/d");
  bytes("a/c");
  std::vector<std::string> found;
  each_dataset(file_, [&](const std::string& name) { found.push_back(name); });
  EXPECT_THAT(found, ElementsAre("a/c", "a/d", "b"));
}

// The targets are valid and in the same file: the link is refused because it is a soft link.
TEST_F(Guard, LinksAreNotFollowed) {
  bytes("real/x");
  ASSERT_GE(H5Lcreate_soft("/real/x", file_, "soft", H5P_DEFAULT, H5P_DEFAULT), 0);
  ASSERT_GE(H5Lcreate_soft("/real", file_, "group", H5P_DEFAULT, H5P_DEFAULT), 0);
  EXPECT_FALSE(exists(file_, "soft"));
  EXPECT_FALSE(exists(file_, "group/x"));
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)open_dataset(file_, "soft"); }),
              HasSubstr("'soft' is a soft"));
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)open_dataset(file_, "group/x"); }),
              HasSubstr("'group' is a soft link, which is not followed"));
  EXPECT_THAT(walk(), HasSubstr("is a soft link, which is not followed"));

  create_file(dir_.file("other.h5")).close("other.h5");
  ASSERT_GE(H5Lcreate_external(dir_.file("other.h5").c_str(), "/", file_, "outside", H5P_DEFAULT,
                               H5P_DEFAULT),
            0);
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)open_group(file_, "outside"); }),
              HasSubstr("'outside' is an external link"));
}

TEST_F(Guard, CyclesAndDeepGroupsAreRefused) {
  create_group(file_, "a/b");
  ASSERT_GE(H5Lcreate_hard(file_, "a", file_, "a/b/again", H5P_DEFAULT, H5P_DEFAULT), 0);
  EXPECT_THAT(walk(), HasSubstr("is a group that occurs twice"));
  ASSERT_GE(H5Ldelete(file_, "a", H5P_DEFAULT), 0);

  std::string deep = "g";
  for (int i = 1; i < kMaxDepth; ++i) deep += "/g";
  create_group(file_, deep);
  EXPECT_EQ(walk(), "");
  create_group(file_, deep + "/g");
  EXPECT_THAT(walk(), HasSubstr("is nested too deeply: more than 32 groups"));
}

TEST_F(Guard, DataInOtherFilesIsNotRead) {
  std::FILE* outside = std::fopen(dir_.file("outside").c_str(), "w");
  ASSERT_NE(outside, nullptr);
  std::fputs("secret", outside);
  std::fclose(outside);
  const Id elsewhere = dataset_properties();
  ASSERT_GE(H5Pset_external(elsewhere, dir_.file("outside").c_str(), 0, 3), 0);
  EXPECT_THAT(storage(bytes("x", {3}, elsewhere)), HasSubstr("is stored in external files"));
  const Id text(H5Tcopy(H5T_C_S1), H5Tclose, "type"), one(H5Screate(H5S_SCALAR), H5Sclose, "space");
  ASSERT_GE(H5Tset_size(text, 3), 0);
  const Id secret(H5Dcreate2(file_, "text", text, one, link_properties(), elsewhere, H5P_DEFAULT),
                  H5Dclose, "text");
  EXPECT_THAT(error_of<RuntimeError>([&] { read_text(file_, "text"); }),
              HasSubstr("is stored in external files"));

  const Id composed = dataset_properties();
  const hsize_t size = 3;
  const Id space(H5Screate_simple(1, &size, nullptr), H5Sclose, "space");
  ASSERT_GE(H5Pset_virtual(composed, space, dir_.file("other.h5").c_str(), "x", space), 0);
  EXPECT_THAT(storage(bytes("y", {3}, composed)), HasSubstr("is a virtual dataset"));
}

TEST_F(Guard, SizesAreBoundedByTheStoredData) {
  const auto chunked = [](std::vector<hsize_t> chunk) {
    Id properties = dataset_properties();
    H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data());
    return properties;
  };
  constexpr hsize_t kMiB = 1 << 20;
  EXPECT_EQ(storage(bytes("plain")), "");
  EXPECT_EQ(storage(bytes("empty", {0, 5}, chunked({1, 5}))), "");
  // No data has been written; a small size is accepted nevertheless.
  EXPECT_EQ(storage(bytes("small", {60 * kMiB}, chunked({kMiB}))), "");
  EXPECT_THAT(storage(bytes("endless", {10'000'000 * kMiB}, chunked({kMiB}))),
              HasSubstr("declares 10485760000000 bytes but stores 0"));
  EXPECT_THAT(storage(bytes("wide", {1, 65 * kMiB}, chunked({1, kMiB}))),
              HasSubstr("has rows of 68157440 bytes"));
  EXPECT_THAT(storage(bytes("large", {130, kMiB}, chunked({65, kMiB}))),
              HasSubstr("has chunks of 68157440 bytes"));
}

TEST_F(Guard, ReadsRowsOfBytes) {
  const Id written = bytes("x");
  ASSERT_GE(H5Dwrite(written, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, "abc"), 0);
  EXPECT_EQ(read_bytes(file_, "x", 3), "abc");
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)read_bytes(file_, "x", 2); }),
              HasSubstr("has 3 bytes, expected at most 2"));
  bytes("table", {2, 2}, dataset_properties());
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)read_bytes(file_, "table", 100); }),
              HasSubstr("is not a one-dimensional array of bytes"));
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)read_bytes(file_, "missing", 3); }),
              HasSubstr("'missing' does not exist"));
  create_group(file_, "group");
  EXPECT_THAT(error_of<RuntimeError>([&] { (void)read_bytes(file_, "group", 3); }),
              HasSubstr("is not a dataset"));
}

}  // namespace
}  // namespace mjsense::hdf5
