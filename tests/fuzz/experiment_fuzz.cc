// SPDX-License-Identifier: Apache-2.0
// Fuzz target for experiment files: a file is either read or rejected with one readable error.

#include "mjsense/app/field_options.h"
#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense_tasks/rollout/record_job.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  tasks::rollout::RecordJobCfg job;
  try {
    app::read_toml_text({reinterpret_cast<const char*>(data), size}, "experiment.toml",
                        struct_of<tasks::rollout::RecordJobCfg>(), &job);
    check_fields(job, "");  // the fields were also checked while reading
  } catch (const Error& e) {
    if (!std::string_view(e.what()).starts_with("experiment.toml"))
      fuzz::broken("an error names the file", e.what());
  }
  return 0;
}
