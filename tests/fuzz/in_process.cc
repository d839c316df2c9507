// SPDX-License-Identifier: Apache-2.0
// Replaces hdf5/in_child.cc in the fuzz targets: readers run in this process, so that the fuzzer
// can trace their execution.

#include "mjsense/core/error.h"
#include "mjsense/hdf5/guard.h"

namespace mjsense::h5 {

std::string in_child(std::string_view, std::uint64_t, const std::function<std::string()>& read,
                     std::uint64_t, int) {
  try {
    return read();
  } catch (const std::exception& e) {
    throw RuntimeError(e.what());
  }
}

}  // namespace mjsense::h5
