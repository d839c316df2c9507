// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/record_command.h"

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "mjsense/app/progress.h"
#include "mjsense/app/text_table.h"
#include "mjsense/core/error.h"
#include "mjsense/core/system/print_stderr.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::app {
namespace {

tasks::rollout::StopFlag stop_flag{0};

// Handles Ctrl-C and SIGTERM during its lifetime. The first signal finishes the running episodes,
// the second discards them, the third exits immediately.
class StopOnSignal {
 public:
  StopOnSignal() {
    struct sigaction action = {};
    action.sa_handler = [](int signal) {
      if (++stop_flag > 2) _exit(128 + signal);
    };
    stop_flag = 0;
    sigaction(SIGINT, &action, &old_int_);
    sigaction(SIGTERM, &action, &old_term_);
  }
  ~StopOnSignal() {
    sigaction(SIGINT, &old_int_, nullptr);
    sigaction(SIGTERM, &old_term_, nullptr);
  }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

 private:
  struct sigaction old_int_ = {}, old_term_ = {};
};

std::uint64_t bytes_below(const std::filesystem::path& folder) {
  std::uint64_t bytes = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) bytes += entry.file_size();
  }
  return bytes;
}

// "pick with NAME (the task's robot) in table: 8 episodes into data".
std::string title(const tasks::rollout::RecordJobCfg& job) {
  const tasks::rollout::RolloutCfg cfg = tasks::rollout::resolved(job.rollout);
  std::string text = cfg.task;
  if (!cfg.robot.empty()) {
    const bool named = cfg.robot == job.rollout.robot;
    text += fmt::format(" with {}{}", cfg.robot, named ? "" : " (the task's robot)");
  }
  if (!cfg.scene.empty()) text += " in " + cfg.scene;
  const std::int64_t count = job.num_attempts > 0 ? job.num_attempts : job.episodes;
  return text + fmt::format(": {} {}{} into {}", count,
                            job.num_attempts > 0 ? "attempt" : "episode", count == 1 ? "" : "s",
                            job.out.string());
}

// Wall time (s) per stage; the last entry is the remainder.
std::vector<std::pair<std::string, double>> time_split(const tasks::rollout::RecordSummary& s) {
  std::vector<std::pair<std::string, double>> split = {{"policy", s.times.policy + s.times.reset},
                                                       {"physics", s.times.physics},
                                                       {"sensing", s.times.sensing},
                                                       {"rendering", s.times.rendering},
                                                       {"recording", s.recording_s}};
  double known = 0;
  for (const auto& [name, seconds] : split) known += seconds;
  split.emplace_back("rest", std::max(0.0, s.progress.seconds - known));
  return split;
}

// A contact sheet of the recording, and the text that says what it shows.
struct Sheet {
  std::string path, shows;
};

std::string summary_text(const tasks::rollout::RecordSummary& s, const Sheet& sheet, bool tree) {
  const tasks::rollout::RecordProgress& p = s.progress;
  const int ended = p.succeeded + p.failed;
  std::string out;
  if (ended > 0) {
    out += fmt::format("{} of {} attempts succeeded ({:.0f} %); {} of {} episodes are on disk\n",
                       p.succeeded, ended, 100.0 * p.succeeded / ended, p.kept, p.wanted);
  } else {
    out += fmt::format("{} of {} episodes are on disk\n", p.kept, p.wanted);
  }
  for (const auto& [why, count] : s.failures) out += fmt::format("  {} x {}\n", count, why);
  if (p.steps > 0) {
    const double rate = 1 / std::max(p.seconds, 1e-9);
    out += fmt::format(
        "{} steps in {:.1f} s: {:.1f} steps/s, {:.0f} physics steps/s, {:.1f} frames/s\n", p.steps,
        p.seconds, static_cast<double>(p.steps) * rate, static_cast<double>(p.physics_steps) * rate,
        static_cast<double>(p.frames) * rate);
    out += "time:";
    for (const auto& [name, seconds] : time_split(s)) {
      out += fmt::format("  {} {:.0f} %", name, 100 * seconds * rate);
    }
    out += fmt::format("  (in parallel: encoders {:.1f} s, files {:.1f} s)\n",
                       s.record.encode_cpu_s, s.record.write_s + s.record.commit_s);
  }
  if (tree && std::filesystem::exists(s.house_dir)) {
    out += fmt::format("\n{}{} in total\n", tree_text(s.house_dir.string()),
                       bytes_text(static_cast<double>(bytes_below(s.house_dir))));
  }
  if (!sheet.path.empty())
    out +=
        fmt::format("\ncontact sheet, every camera over time ({}): {}\n", sheet.shows, sheet.path);
  return out;
}

std::string summary_json(const tasks::rollout::RecordSummary& s, const Sheet& sheet) {
  nlohmann::json out;
  const tasks::rollout::RecordProgress& p = s.progress;
  out["kept"] = p.kept;
  out["wanted"] = p.wanted;
  out["attempts"] = p.succeeded + p.failed;
  out["succeeded"] = p.succeeded;
  out["failed"] = p.failed;
  out["failures"] = s.failures;
  out["interrupted"] = s.interrupted;
  out["observations"] = s.lengths;
  out["steps"] = p.steps;
  out["physics_steps"] = p.physics_steps;
  out["frames"] = p.frames;
  out["seconds"] = p.seconds;
  for (const auto& [name, seconds] : time_split(s)) out["time"][name] = seconds;
  out["encode_cpu_s"] = s.record.encode_cpu_s;
  out["write_s"] = s.record.write_s + s.record.commit_s;
  out["raw_bytes"] = s.record.raw_bytes;
  out["path"] = s.house_dir.string();
  out["contact_sheet"] = sheet.path.empty() ? nlohmann::json() : nlohmann::json(sheet.path);
  return out.dump(2) + "\n";
}

}  // namespace

int run_record(const RecordOptions& options) {
  if (options.job.out.empty())
    throw ValueError("record: the output directory is missing: pass --out DIR");
  const tasks::rollout::RecordJobCfg job = tasks::rollout::without_shard(options.job);
  tasks::rollout::RecordSummary summary;
  {
    const StopOnSignal signals;
    ProgressLine line(title(job), options.quiet);
    try {
      summary = tasks::rollout::record_episodes(
          job, [&](const tasks::rollout::RecordProgress& p) { line.show(p, stop_flag.load()); },
          &stop_flag);
    } catch (...) {
      line.finish();
      throw;
    }
    line.finish();
  }
  Sheet sheet;
  if (options.sheet && summary.progress.kept > 0 && summary.progress.frames > 0 &&
      !summary.interrupted) {
    sheet.path = (job.out / "contact_sheet.png").string();
    sheet.shows = replay::contact_sheet(summary.house_dir, sheet.path, 4, 8, job.video.ffmpeg);
  }
  if (options.json) {
    fmt::print("{}", summary_json(summary, sheet));
  } else if (!options.quiet) {
    fmt::print("{}", summary_text(summary, sheet, options.tree));
  }
  for (const std::string& damage : summary.damage) print_stderr("mjsense: {}\n", damage);
  if (summary.interrupted) {
    print_stderr(
        "interrupted: the finished episodes are safe. Continue with --resume, or finish with "
        "`mjsense repair {}`.\n",
        summary.house_dir.string());
  } else if (!summary.enough) {
    print_stderr("stopped after {} attempts; --max-attempts allows more\n",
                 summary.progress.succeeded + summary.progress.failed);
  }
  return summary.enough ? 0 : 1;
}

}  // namespace mjsense::app
