// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/staged_episode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/hdf5/h5.h"

namespace mjsense::record {
namespace {

using ::testing::HasSubstr;

// An episode of two steps with a compressed dataset of lists whose only chunk has these bytes.
void write_episode(const std::filesystem::path& path, const std::string& chunk) {
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::create_file(path);
  hdf5::create_group(file, "traj_0/obs/sensor_data");
  const hsize_t steps = 2;
  const hdf5::Id space(H5Screate_simple(1, &steps, nullptr), H5Sclose, "space");
  const hdf5::Id success(H5Dcreate2(file, "traj_0/success", hdf5::memory_type(DType::kBool), space,
                                    H5P_DEFAULT, hdf5::dataset_properties(), H5P_DEFAULT),
                         H5Dclose, "success");
  const hdf5::Id lists(H5Tvlen_create(H5T_STD_U8LE), H5Tclose, "type");
  const hdf5::Id properties = hdf5::dataset_properties();
  hdf5::check(H5Pset_chunk(properties, 1, &steps), "chunk");
  hdf5::check(H5Pset_deflate(properties, 1), "deflate");
  const hdf5::Id dataset(
      H5Dcreate2(file, "traj_0/x", lists, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
      "x");
  const hsize_t at = 0;
  hdf5::check(H5Dwrite_chunk(dataset, H5P_DEFAULT, 0, &at, chunk.size(), chunk.data()), "chunk");
}

// Without the check, the HDF5 library would copy the chunk anyway and free its memory twice.
TEST(StagedEpisode, CorruptChunkThrows) {
  const testing::TempDir dir;
  write_episode(dir.file("traj.h5"), "no stream");
  EXPECT_THAT(
      error_of<RuntimeError>([&] { static_cast<void>(read_staged(Folder::open(dir.path))); }),
      HasSubstr("'x' is damaged: one of its chunks does not decompress"));
}

}  // namespace
}  // namespace mjsense::record
