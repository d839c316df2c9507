// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/mujoco_log.h"

#include <mujoco/mujoco.h>

#include <string_view>

namespace mjsense {

void leave_no_log_file() {
  mjLogConfig config = mju_getLogConfig();
  if (std::string_view(config.logfile) != "MUJOCO_LOG.TXT") return;
  config.logto_file = 0;
  mju_setLogConfig(config);
}

}  // namespace mjsense
