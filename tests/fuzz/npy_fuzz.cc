// SPDX-License-Identifier: Apache-2.0
// Fuzz target for tables of scan angles in NumPy's format: reading returns all rows of the file or
// throws an error.

#include "mjsense/core/error.h"
#include "mjsense/sensors/lidar/npy.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  static fuzz::MemoryFile file;
  file.write(data, size);
  try {
    const auto pairs = sensors::read_npy_pairs(file.path(), "sensor 'lidar'");
    if (pairs.empty() || 8 * pairs.size() > size)
      fuzz::broken("rows are no larger than the file", "");
  } catch (const Error& e) {
    if (!std::string_view(e.what()).starts_with("sensor 'lidar': scan table '/proc"))
      fuzz::broken("an error names sensor and file", e.what());
  }
  return 0;
}
