// SPDX-License-Identifier: Apache-2.0
// Replaces hdf5/child_reader.cc in the fuzz targets: readers run in this process, so that the
// fuzzer can trace their execution.

#include "mjsense/core/error.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {

std::string in_child(std::string_view, std::uint64_t, const std::function<std::string()>& read,
                     std::uint64_t, int) {
  try {
    return read();
  } catch (const std::exception& e) {
    throw RuntimeError(e.what());
  }
}

}  // namespace mjsense::hdf5
