// SPDX-License-Identifier: Apache-2.0
#pragma once
// The progress of a recording: on a terminal one line that is rewritten, otherwise one line for
// each episode. The title is printed once, when the recording has begun, so that an error in the
// configuration is printed without it.

#include <chrono>
#include <string>

#include "mjsense_tasks/rollout/record_job.h"

namespace mjsense::app {

class ProgressLine {
 public:
  ProgressLine(std::string title, bool quiet);
  void show(const tasks::rollout::RecordProgress& progress, int stop_level);
  void finish();  // ends the line and keeps its text

 private:
  void print();

  std::string title_;  // cleared once it is shown
  bool quiet_, terminal_;
  bool open_ = false;
  std::string text_, printed_;
  int shown_ended_ = -1;
  double shown_at_ = -1e9;
};

// A text on stderr that is rewritten, if that is a terminal; the destructor clears it.
class StatusLine {
 public:
  explicit StatusLine(bool quiet);
  ~StatusLine();
  StatusLine(const StatusLine&) = delete;
  StatusLine& operator=(const StatusLine&) = delete;
  void show(const std::string& text);

 private:
  bool enabled_;
  std::chrono::steady_clock::time_point due_;  // before this time a text is not shown
};

// "3/8 episodes  100 % success  412 steps/s  824 frames/s  0:42 left"
std::string progress_text(const tasks::rollout::RecordProgress& progress);
// "1:05:09", "0:42"
std::string clock_text(double seconds);
// "412 B", "3.4 kB", "1.2 MB"
std::string bytes_text(double bytes);

}  // namespace mjsense::app
