// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading what h5py wrote with compression="lzf", as MolmoSpaces does: the filter is h5py's and not
// part of the HDF5 library. liblzf would save 40 of these 86 lines and cost a dependency.

#include <cstddef>
#include <cstdint>
#include <span>

namespace mjsense {

inline constexpr int kLzfFilter = 32000;  // registered with the HDF Group

// Bytes written to `out`; 0 if `packed` is damaged or needs more room.
std::size_t lzf_unpack(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out);

void register_lzf();  // with the HDF5 library; hold an H5Lock

}  // namespace mjsense
