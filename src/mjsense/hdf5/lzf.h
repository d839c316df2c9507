// SPDX-License-Identifier: Apache-2.0
#pragma once
// Decoder for HDF5 data compressed by h5py with compression="lzf", as in MolmoSpaces' files. The
// filter is part of h5py and not of the HDF5 library. liblzf would save 40 of these 86 lines at the
// cost of a dependency.

#include <cstddef>
#include <cstdint>
#include <span>

namespace mjsense::hdf5 {

inline constexpr int kLzfFilter = 32000;  // registered with the HDF Group

// Returns the number of bytes written to `out`, or 0 if `packed` is damaged or needs more space.
std::size_t lzf_unpack(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out);

void register_lzf();  // registers the filter with the HDF5 library; hold an H5Lock

}  // namespace mjsense::hdf5
