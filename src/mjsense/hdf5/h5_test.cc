// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/h5.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/temp_dir.h"

namespace mjsense::hdf5 {
namespace {

class H5 : public ::testing::Test {
 protected:
  H5Lock lock_;
  mjsense::testing::TempDir dir_;
  Id file_ = create_file(dir_.file("x.h5"));
};

TEST_F(H5, AttributesHaveTheirValuesOrTheDefault) {
  set_attribute(file_, "text", "näher");
  set_attribute(file_, "whole", std::int64_t{-7});
  set_attribute(file_, "large", std::uint64_t{1} << 40);
  set_attribute(file_, "real", 0.25);
  EXPECT_TRUE(has_attribute(file_, "text"));
  EXPECT_EQ(text_attribute(file_, "text"), "näher");
  EXPECT_EQ(int_attribute(file_, "whole", 3), -7);
  EXPECT_EQ(int_attribute(file_, "large", 3), std::int64_t{1} << 40);
  EXPECT_EQ(double_attribute(file_, "real", 3), 0.25);

  EXPECT_FALSE(has_attribute(file_, "absent"));
  EXPECT_EQ(text_attribute(file_, "absent"), "");
  EXPECT_EQ(int_attribute(file_, "absent", 3), 3);
  EXPECT_EQ(double_attribute(file_, "absent", 1.5), 1.5);

  EXPECT_THROW((void)int_attribute(file_, "text", 3), RuntimeError);
  EXPECT_THROW((void)text_attribute(file_, "real"), RuntimeError);
}

// Readers in other languages decode a text as its type says.
TEST_F(H5, TextIsUtf8) {
  write_text(file_, "a/b", "näher");
  EXPECT_EQ(read_text(file_, "a/b"), "näher");
  const Id dataset(H5Dopen2(file_, "a/b", H5P_DEFAULT), H5Dclose, "a/b");
  const Id type(H5Dget_type(dataset), H5Tclose, "type");
  EXPECT_EQ(H5Tget_cset(type), H5T_CSET_UTF8);
  EXPECT_GT(H5Tis_variable_str(type), 0);
}

TEST_F(H5, ExistsFollowsHardLinksOnly) {
  write_text(file_, "a/b/c", "x");
  ASSERT_GE(H5Lcreate_soft("/a/b", file_, "soft", H5P_DEFAULT, H5P_DEFAULT), 0);
  for (const char* path : {"a", "a/b", "a/b/c"}) EXPECT_TRUE(exists(file_, path)) << path;
  for (const char* path : {"b", "a/c", "a/b/d", "a/x/c", "soft", "soft/c"})
    EXPECT_FALSE(exists(file_, path)) << path;
  EXPECT_THAT(children(file_), ::testing::ElementsAre("a", "soft"));
}

}  // namespace
}  // namespace mjsense::hdf5
