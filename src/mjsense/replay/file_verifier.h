// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "mjsense/replay/trajectory.h"

namespace mjsense::replay {

// Verifies the structure and the checksums of one HDF5 file of `bytes` bytes. Call it in a separate
// process, because a damaged file can crash the HDF5 library. `sealed`: the file has a checksum of
// the whole. Returns JSON text: "findings" [is_error, place, text], "videos", "episodes", "steps"
// and, if the file names one, "archive".
std::string verify_file(const RecordedFile& recorded, std::uint64_t bytes, bool sealed);

}  // namespace mjsense::replay
