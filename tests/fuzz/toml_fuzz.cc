// SPDX-License-Identifier: Apache-2.0
// Fuzz target for TOML files whose keys are fields, as those of robots, scenes and camera systems: a
// file is either read or rejected with one readable error. The options of a recording stand for all
// structs.

#include "mjsense/core/error.h"
#include "mjsense/core/fields/toml_fields.h"
#include "mjsense_tasks/rollout/record_job.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  tasks::rollout::RecordJobCfg job;
  try {
    read_toml_fields({reinterpret_cast<const char*>(data), size}, "file.toml", job);
  } catch (const Error& e) {
    if (!std::string_view(e.what()).starts_with("file.toml"))
      fuzz::broken("an error names the file", e.what());
  }
  return 0;
}
