// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/lzf.h"

#include <hdf5.h>

#include <cstdlib>
#include <cstring>

namespace mjsense::hdf5 {
namespace {

std::size_t filter(unsigned flags, std::size_t count, const unsigned* values, std::size_t bytes,
                   std::size_t* capacity, void** buffer) {
  if (!(flags & H5Z_FLAG_REVERSE)) return 0;  // reading only
  std::size_t size =
      count >= 3 && values[2] > 0 ? values[2] : *capacity;  // h5py stores the chunk's size
  for (int tries = 0; tries < 8; ++tries, size *= 2) {
    void* out = H5allocate_memory(size, false);
    if (out == nullptr) return 0;
    const std::size_t n = lzf_unpack({static_cast<const std::uint8_t*>(*buffer), bytes},
                                     {static_cast<std::uint8_t*>(out), size});
    if (n > 0) {
      H5free_memory(*buffer);
      *buffer = out;
      *capacity = size;
      return n;
    }
    H5free_memory(out);
  }
  return 0;
}

}  // namespace

std::size_t lzf_unpack(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  std::size_t in = 0, at = 0;
  while (in < packed.size()) {
    const unsigned control = packed[in++];
    if (control < 32) {  // a literal run of control + 1 bytes
      const std::size_t run = control + 1;
      if (in + run > packed.size() || at + run > out.size()) return 0;
      std::memcpy(&out[at], &packed[in], run);
      in += run;
      at += run;
      continue;
    }
    // A back reference: 3 bits of length, 13 bits of distance.
    std::size_t length = control >> 5;
    if (length == 7) {
      if (in >= packed.size()) return 0;
      length += packed[in++];
    }
    if (in >= packed.size()) return 0;
    const std::size_t distance = ((control & 31u) << 8) + packed[in++] + 1;
    length += 2;
    if (distance > at || at + length > out.size()) return 0;
    for (std::size_t i = 0; i < length; ++i, ++at)
      out[at] = out[at - distance];  // source and destination may overlap
  }
  return at;
}

void register_lzf() {
  if (H5Zfilter_avail(kLzfFilter) > 0) return;
  static const H5Z_class2_t kClass{H5Z_CLASS_T_VERS, kLzfFilter, 0,     1, "lzf",
                                   nullptr,          nullptr,    filter};
  H5Zregister(&kClass);
}

}  // namespace mjsense::hdf5
