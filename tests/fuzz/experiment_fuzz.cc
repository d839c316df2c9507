// SPDX-License-Identifier: Apache-2.0
// An experiment file: it is read, or refused by one error that a person can read.

#include "mjsense/app/field_options.h"
#include "mjsense/core/error.h"
#include "mjsense/rollout/record_job.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  RecordJobCfg job;
  try {
    read_toml_text({reinterpret_cast<const char*>(data), size}, "experiment.toml",
                   struct_of<RecordJobCfg>(), &job);
    check_fields(job, "");  // each was checked as it was read
  } catch (const Error& e) {
    if (!std::string_view(e.what()).starts_with("experiment.toml"))
      fuzz::broken("an error names the file", e.what());
  }
  return 0;
}
