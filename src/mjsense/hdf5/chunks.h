// SPDX-License-Identifier: Apache-2.0
#pragma once
// The HDF5 library believes that a chunk is, once unpacked, as long as its shape says, and reads
// beyond the end of one that is not. So chunks are unpacked here first.

#include <string>

#include "mjsense/hdf5/h5.h"

namespace mjsense::h5 {

// Throws RuntimeError unless every stored chunk of `dataset` unpacks to its size. Packed means by
// gzip or lzf, with shuffle and fletcher32 or without; other filters are refused.
void check_chunks(hid_t dataset, const std::string& name);

}  // namespace mjsense::h5
