// SPDX-License-Identifier: Apache-2.0
// Fuzz target for the tables of MP4 and Matroska files: values in the tables are bounded by the
// size of the file.

#include "mjsense/record/video_file.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  static fuzz::MemoryFile file;
  file.write(data, size);
  const record::VideoFacts facts = record::read_video_facts(file.fd());
  if (facts.frames < 0 || facts.width < 0 || facts.height < 0)
    fuzz::broken("sizes are not negative", "");
  if (facts.error.empty() && static_cast<std::uint64_t>(facts.frames) > size)
    fuzz::broken("every frame takes at least one byte", "");
  return 0;
}
