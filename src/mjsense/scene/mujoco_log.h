// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace mjsense {

// MuJoCo writes what it warns of also to MUJOCO_LOG.TXT in the current folder, which is somebody's.
// From here on it does not; a file that was chosen by mju_setLogConfig() stays. For programs: it
// changes the process.
void leave_no_log_file();

}  // namespace mjsense
