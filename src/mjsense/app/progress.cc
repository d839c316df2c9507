// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <utility>

#include "mjsense/app/terminal.h"
#include "mjsense/core/system/print_stderr.h"

namespace mjsense::app {

std::string clock_text(double seconds) {
  const auto s = static_cast<long>(std::lround(seconds));
  if (s >= 3600) return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
  return fmt::format("{}:{:02}", s / 60, s % 60);
}

std::string bytes_text(double bytes) {
  const char* units[] = {"B", "kB", "MB", "GB", "TB"};
  int unit = 0;
  while (bytes >= 999.5 && unit < 4) bytes /= 1000, ++unit;
  return unit == 0 || bytes >= 99.95 ? fmt::format("{:.0f} {}", bytes, units[unit])
                                     : fmt::format("{:.1f} {}", bytes, units[unit]);
}

std::string progress_text(const tasks::rollout::RecordProgress& p) {
  const int ended = p.succeeded + p.failed;
  std::string text = fmt::format("{}/{} episodes", p.kept, p.wanted);
  text += ended ? fmt::format("  {:.0f} % success", 100.0 * p.succeeded / ended) : "";
  const double seconds = std::max(p.seconds, 1e-9);
  text += fmt::format("  {:.0f} steps/s", static_cast<double>(p.steps) / seconds);
  if (p.frames) text += fmt::format("  {:.0f} frames/s", static_cast<double>(p.frames) / seconds);
  const double left = p.seconds_left();
  if (!std::isnan(left) && p.kept < p.wanted) text += fmt::format("  {} left", clock_text(left));
  return text;
}

StatusLine::StatusLine(bool quiet) : enabled_(!quiet && isatty(STDERR_FILENO) != 0) {}

StatusLine::~StatusLine() {
  if (enabled_) print_stderr_raw("\r\033[K");
}

void StatusLine::show(const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (!enabled_ || now < due_) return;
  due_ = now + std::chrono::milliseconds(100);
  print_stderr_raw("\r\033[K" + text.substr(0, terminal_width(STDERR_FILENO) - 1));
}

ProgressLine::ProgressLine(std::string title, bool quiet)
    : title_(std::move(title)), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

void ProgressLine::show(const tasks::rollout::RecordProgress& progress, int stop_level) {
  if (quiet_) return;
  if (!title_.empty()) print_stderr("{}\n", std::exchange(title_, {}));
  text_ = progress_text(progress);
  if (stop_level > 0 && progress.running > 0) {
    text_ += fmt::format("  stopping: {} running; Ctrl-C discards them", progress.running);
  }
  if (terminal_) {
    // A longer line would wrap, and "\r" would not return to its beginning.
    print_stderr_raw("\r\033[K" + text_.substr(0, terminal_width(STDERR_FILENO) - 1));
    std::fflush(stderr);
    open_ = true;
    return;
  }
  const int ended = progress.succeeded + progress.failed;
  const double quiet_for = progress.seconds - shown_at_;
  if (quiet_for < 1 || (ended == shown_ended_ && quiet_for < 10)) return;
  shown_ended_ = ended;
  shown_at_ = progress.seconds;
  print();
}

void ProgressLine::print() {
  print_stderr("{}\n", text_);
  printed_ = text_;
}

void ProgressLine::finish() {
  if (open_) print_stderr("\n");
  if (!terminal_ && text_ != printed_) print();
  open_ = false;
}

}  // namespace mjsense::app
