// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checks of HDF5 chunks. The HDF5 library assumes that an unpacked chunk is as long as its shape
// says, and reads beyond the end of one that is not. Chunks are therefore unpacked here first.

#include <string>

#include "mjsense/hdf5/h5.h"

namespace mjsense::hdf5 {

// Throws RuntimeError unless every stored chunk of `dataset` unpacks to its size. Supported filters
// are gzip and lzf, with or without shuffle and fletcher32; others are refused.
void check_chunks(hid_t dataset, const std::string& name);

}  // namespace mjsense::hdf5
