// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/chunk_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <numeric>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr hsize_t kRows = 25, kChunk = 10, kColumns = 4;
constexpr std::size_t kChunkBytes = kChunk * kColumns * sizeof(float);

// float32 [25, 4] in chunks of ten rows, without data.
Id empty_dataset(hid_t file, const Id& properties) {
  const hsize_t size[] = {kRows, kColumns}, chunk[] = {kChunk, kColumns};
  const Id space(H5Screate_simple(2, size, nullptr), H5Sclose, "space");
  check(H5Pset_chunk(properties, 2, chunk), "chunk");
  return {H5Dcreate2(file, "x", H5T_IEEE_F32LE, space, H5P_DEFAULT, properties, H5P_DEFAULT),
          H5Dclose, "x"};
}

// The same, with data written through the filters of `properties`.
Id dataset(hid_t file, const Id& properties) {
  Id made = empty_dataset(file, properties);
  std::vector<float> values(kRows * kColumns);
  std::iota(values.begin(), values.end(), 0.5f);
  check(H5Dwrite(made, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "x");
  return made;
}

std::string complaint(hid_t made) {
  return error_of<RuntimeError>([&] { check_chunks(made, "x"); });
}

class Chunks : public ::testing::Test {
 protected:
  H5Lock lock_;
  mjsense::testing::TempDir dir_;
  Id file_ = create_file(dir_.file("x.h5"));
  Id properties_ = dataset_properties();
};

TEST_F(Chunks, ChunksOfTheLibraryAreAccepted) {
  EXPECT_THAT(complaint(dataset(file_, properties_)), IsEmpty());  // no filter
  H5Ldelete(file_, "x", H5P_DEFAULT);
  H5Pset_shuffle(properties_);
  H5Pset_deflate(properties_, 4);
  H5Pset_fletcher32(properties_);
  EXPECT_THAT(complaint(dataset(file_, properties_)), IsEmpty());
  // Chunks that were never written are not checked.
  H5Ldelete(file_, "x", H5P_DEFAULT);
  EXPECT_THAT(complaint(empty_dataset(file_, properties_)), IsEmpty());
}

// The library would read beyond the end of a chunk that is shorter than its shape says.
TEST_F(Chunks, ChunksThatUnpackToAnotherSizeAreRefused) {
  H5Pset_deflate(properties_, 4);
  const Id made = dataset(file_, properties_);
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{8}, kChunkBytes - 1, kChunkBytes,
                                  kChunkBytes + 1, 100 * kChunkBytes}) {
    const std::vector<std::uint8_t> plain(bytes, 7);
    std::vector<std::uint8_t> packed(compressBound(bytes));
    uLongf size = packed.size();
    ASSERT_EQ(compress(packed.data(), &size, plain.data(), bytes), Z_OK);
    const hsize_t at[] = {kChunk, 0};
    check(H5Dwrite_chunk(made, H5P_DEFAULT, 0, at, size, packed.data()), "chunk");
    if (bytes == kChunkBytes) {
      EXPECT_THAT(complaint(made), IsEmpty());
    } else {
      EXPECT_EQ(complaint(made),
                "'x' is damaged: one of its chunks does not decompress to 160 bytes")
          << bytes;
    }
  }
  const hsize_t at[] = {2 * kChunk, 0};
  check(H5Dwrite_chunk(made, H5P_DEFAULT, 0, at, 9, "no stream"), "chunk");
  EXPECT_THAT(complaint(made), HasSubstr("does not decompress"));
  // A bit of the chunk says that the filter was skipped; then the stored size must be that of the
  // chunk.
  check(H5Dwrite_chunk(made, H5P_DEFAULT, 1, at, kChunkBytes, std::string(kChunkBytes, 'x').data()),
        "chunk");
  const hsize_t middle[] = {kChunk, 0};
  check(H5Dwrite_chunk(made, H5P_DEFAULT, 1, middle, 20, "short, and not packed"), "chunk");
  EXPECT_THAT(complaint(made), HasSubstr("does not decompress"));
}

// The index stores a size for a chunk without filters too, and the library allocates that much.
TEST_F(Chunks, UnfilteredChunksOfAnotherSizeAreRefused) {
  for (const std::size_t bytes : {std::size_t{15}, kChunkBytes - 1, kChunkBytes, kChunkBytes + 1}) {
    const Id made = empty_dataset(file_, properties_);
    const hsize_t at[] = {kChunk, 0};
    check(H5Dwrite_chunk(made, H5P_DEFAULT, 0, at, bytes, std::string(bytes, 'x').data()), "chunk");
    if (bytes == kChunkBytes) {
      EXPECT_THAT(complaint(made), IsEmpty());
    } else {
      EXPECT_EQ(complaint(made), "'x' is damaged: one of its chunks has " + std::to_string(bytes) +
                                     " bytes, expected 160");
    }
    H5Ldelete(file_, "x", H5P_DEFAULT);
  }
}

TEST_F(Chunks, OtherFiltersAreRefused) {
  H5Pset_nbit(properties_);
  EXPECT_THAT(complaint(dataset(file_, properties_)),
              HasSubstr("is compressed with filter 5, which is not supported: gzip and lzf are"));
}

}  // namespace
}  // namespace mjsense::hdf5
