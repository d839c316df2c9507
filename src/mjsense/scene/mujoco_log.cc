// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/mujoco_log.h"

#include <fmt/format.h>

#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "mjsense/core/system/print_stderr.h"

namespace mjsense::scene {
namespace {

std::mutex capture_mutex;
std::atomic<mjfLogHandler> chained = nullptr;
thread_local std::vector<std::string>* captured = nullptr;
thread_local bool dropping = false;

void on_message(const mjLogMessage* message) {
  const bool warning = message->level == mjLOG_WARNING;
  if (warning && captured) {
    std::string text = message->subject;
    if (message->body) text += fmt::format(": {}", message->body);
    captured->push_back(std::move(text));
  } else if (warning && dropping) {
    return;
  } else if (const mjfLogHandler next = chained) {
    next(message);
  }
}

// With the mutex locked. Returns the handler that was there.
mjfLogHandler install() {
  const mjfLogHandler previous = mju_setLogHandler(on_message);
  if (previous != on_message) chained = previous;
  return previous;
}

}  // namespace

void disable_mujoco_log_file() {
  mjLogConfig config = mju_getLogConfig();
  if (std::string_view(config.logfile) != "MUJOCO_LOG.TXT") return;
  config.logto_file = 0;
  mju_setLogConfig(config);
}

void print_warnings_once() {
  mju_user_warning = [](const char* text) {
    static std::mutex mutex;
    static std::set<std::string> shown;
    std::string warning = text;
    if (warning.find("simulation is unstable") != std::string::npos) return;
    warning.erase(warning.find_last_not_of(" \n") + 1);
    for (std::size_t at; (at = warning.find('\n')) != std::string::npos;)
      warning.replace(at, 1, "; ");
    const std::lock_guard lock(mutex);
    if (shown.insert(warning).second) print_stderr("mjsense: MuJoCo: {}\n", warning);
  };
}

WarningCapture::WarningCapture(std::vector<std::string>& messages) {
  capture_mutex.lock();
  captured = &messages;
  previous_ = install();
}

WarningCapture::~WarningCapture() {
  mju_setLogHandler(previous_);
  captured = nullptr;
  capture_mutex.unlock();
}

void install_warning_filter() {
  static const bool once = [] {
    const std::lock_guard lock(capture_mutex);
    install();
    return true;
  }();
  static_cast<void>(once);
}

void drop_warnings(bool on) { dropping = on; }

}  // namespace mjsense::scene
