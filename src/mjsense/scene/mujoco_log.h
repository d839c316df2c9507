// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace mjsense {

// Stops MuJoCo from also writing its warnings to MUJOCO_LOG.TXT in the user's current folder. A log
// file chosen by mju_setLogConfig() is kept. For programs only, because it changes a setting of the
// process.
void leave_no_log_file();

}  // namespace mjsense
