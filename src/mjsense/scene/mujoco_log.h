// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where MuJoCo's messages go.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace mjsense::scene {

// Stops MuJoCo from also writing its warnings to MUJOCO_LOG.TXT in the user's current folder. A log
// file chosen by mju_setLogConfig() is kept. For programs only, because it changes a setting of the
// process.
void disable_mujoco_log_file();

// Prints each of MuJoCo's warnings once from now on, as one line on stderr. Divergence is not printed:
// it is reported with its episode. For programs only, like disable_mujoco_log_file().
void print_warnings_once();

// While one exists, MuJoCo's warnings on this thread are appended to `messages` instead of printed.
// One at a time in the process; the messages of other threads are unaffected.
class WarningCapture {
 public:
  explicit WarningCapture(std::vector<std::string>& messages);
  ~WarningCapture();
  WarningCapture(const WarningCapture&) = delete;
  WarningCapture& operator=(const WarningCapture&) = delete;

 private:
  mjfLogHandler previous_;
};

// Installs a log handler, once in the process, that drops the warnings of threads for which
// drop_warnings(true) was called and passes every other message to the handler that was there.
void install_warning_filter();
// A function and not an object, because MuJoCo's errors jump over destructors.
void drop_warnings(bool on);

}  // namespace mjsense::scene
