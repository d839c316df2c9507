// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <mujoco/mujoco.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "mjsense/app/external.h"
#include "mjsense/app/field_options.h"
#include "mjsense/app/list_command.h"
#include "mjsense/app/record_command.h"
#include "mjsense/app/scan_command.h"
#include "mjsense/app/schema.h"
#include "mjsense/app/sensors_command.h"
#include "mjsense/core/error.h"
#include "mjsense/core/plain_file.h"
#include "mjsense/core/say.h"
#include "mjsense/replay/check.h"
#include "mjsense/rollout/registry.h"
#include "mjsense/scene/mujoco_log.h"

namespace mjsense {
namespace {

constexpr int kFailed = 1;
constexpr int kWrongInput = 2;

// "which task: pick, place"
std::string one_of(const std::string& what, const std::vector<std::string>& names) {
  return fmt::format("{}: {}", what, fmt::join(names, ", "));
}

// What there is to choose from, behind the fields' own words.
void add_choices(CLI::App& app) {
  for (const auto& [option, names] :
       {std::pair{"--robot", robot_names()}, std::pair{"--policy", policy_names()}}) {
    CLI::Option* o = app.get_option(option);
    o->description(one_of(o->get_description(), names));
  }
}

CLI::App& add_record(CLI::App& program, RecordOptions& options) {
  CLI::App& app = *program.add_subcommand("record", "play episodes of a task and keep them");
  app.add_option("task", options.job.rollout.task, one_of("which task", task_names()))
      ->capture_default_str();
  add_field_options(app, struct_of<RecordJobCfg>(), &options.job, {"task"});
  add_set_options(app, struct_of<RecordJobCfg>(), &options.job);
  add_choices(app);
  app.add_option("--config", "TOML file with these options; the command line wins")
      ->type_name("FILE");
  app.add_flag_callback(
      "--no-sheet", [&options] { options.sheet = false; }, "write no contact sheet");
  app.add_flag("--json", options.json, "summary as JSON");
  app.add_flag("-q,--quiet", options.quiet, "no progress");
  return app;
}

// Checks that add nothing to the help: it shows the type's name and the default.
CLI::Validator existing_file() { return CLI::Validator(CLI::ExistingFile).description(""); }
CLI::Validator number_of_steps() { return CLI::Range(0, 1'000'000'000).description(""); }

CLI::App& add_sensors(CLI::App& program, SensorsOptions& options) {
  CLI::App& app = *program.add_subcommand("sensors", "what is measured, and what it costs");
  app.add_option("what", options.what,
                 one_of("an MJCF file, embedded:FILE, or the name of a task", task_names()))
      ->required()
      ->type_name("SCENE.xml|TASK");
  add_field_options(app, struct_of<RolloutCfg>(), &options.rollout, {"task", "worlds"});
  add_set_options(app, struct_of<RolloutCfg>(), &options.rollout);
  add_choices(app);
  app.add_option("--steps", options.steps, "to measure the cost over; 0: do not measure")
      ->capture_default_str()
      ->check(number_of_steps());
  app.add_flag("--json", options.json, "as JSON");
  return app;
}

CLI::App& add_scan(CLI::App& program, ScanOptions& options) {
  CLI::App& app = *program.add_subcommand("scan", "what a lidar sees, as a point cloud");
  app.add_option("scene", options.scene, "an MJCF file, or embedded:FILE")
      ->required()
      ->type_name("SCENE.xml");
  app.add_option("--frame", options.frame, "what carries the lidar: site:NAME, body:NAME, ...")
      ->required()
      ->type_name("TYPE:NAME");
  app.add_option("--out", options.out, "the file, .ply or .pcd")->required()->type_name("FILE");
  // The scene stands still: the rate of a scan and the distortion by motion mean nothing.
  add_field_options(app, struct_of<TableScan>(), &options.table, {"rate-hz"});
  CLI::Option* table = app.get_option("--table")->check(existing_file())->type_name("FILE.npy");
  app.get_option("--rays")->needs(table);
  const std::size_t others = app.get_options().size();
  add_field_options(app, struct_of<SpinningScan>(), &options.spinning, {"rate-hz"});
  const std::vector<CLI::Option*> all = app.get_options({});
  for (std::size_t i = others; i < all.size(); ++i) all[i]->excludes(table);
  add_field_options(app, struct_of<LidarSensorCfg>(), &options.lidar,
                    {"name", "any-frame", "debug-vis", "hit-ids", "motion-distortion"});
  app.add_option("--steps", options.steps, "physics steps before the scan")
      ->capture_default_str()
      ->check(number_of_steps());
  app.add_flag("--world", options.world, "points in the world, not in the lidar's frame");
  return app;
}

struct PathOptions {
  std::string path, sheet, ffmpeg;
  bool json = false, decode = false;
};

CLI::App& add_path_command(CLI::App& program, const char* name, const char* help,
                           PathOptions& options) {
  CLI::App& app = *program.add_subcommand(name, help);
  app.add_option("path", options.path, "a recording, a house_N folder or an .h5 file")->required();
  app.add_flag("--json", options.json, "as JSON");
  return app;
}

// MuJoCo's messages may have several lines.
std::string one_line(std::string text) {
  text.erase(text.find_last_not_of(" \n") + 1);
  for (std::size_t at; (at = text.find('\n')) != std::string::npos;) text.replace(at, 1, "; ");
  return text;
}

// MuJoCo's warnings, each once, on stderr and in no file. A world that diverges is reported with
// its episode.
void show_warnings() {
  mju_user_warning = [](const char* text) {
    static std::mutex mutex;
    static std::set<std::string> shown;
    const std::string warning = text;
    if (warning.find("simulation is unstable") != std::string::npos) return;
    const std::lock_guard lock(mutex);
    if (shown.insert(warning).second) say("mjsense: MuJoCo: {}\n", one_line(warning));
  };
}

const std::string& existing(const std::string& path) {
  if (!std::filesystem::exists(path))
    throw ValueError((path.empty() ? "''" : path) + ": no such file or directory");
  return path;
}

void print(const std::string& text) { fmt::print("{}{}", text, text.ends_with('\n') ? "" : "\n"); }

// --config must be read before the command line is: what is given there wins.
void read_config_argument(int argc, char** argv, RecordOptions& options) {
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--config" && i + 1 < argc)
      read_toml(argv[i + 1], struct_of<RecordJobCfg>(), &options.job);
    if (word.starts_with("--config="))
      read_toml(word.substr(9), struct_of<RecordJobCfg>(), &options.job);
  }
}

int run(int argc, char** argv) {
  show_warnings();
  leave_no_log_file();
  CLI::App program("Senses of MuJoCo worlds: measured, rendered, recorded.", "mjsense");
  program.set_version_flag("--version", "mjsense " MJSENSE_VERSION);
  program.require_subcommand(1);

  RecordOptions record_options;
  SensorsOptions sensors_options;
  ScanOptions scan_options;
  PathOptions inspect_options, verify_options, repair_options;
  CLI::App& record = add_record(program, record_options);
  CLI::App& sensors = add_sensors(program, sensors_options);
  CLI::App& scan = add_scan(program, scan_options);
  CLI::App& inspect_app =
      add_path_command(program, "inspect", "trees, statistics, pictures", inspect_options);
  inspect_app.add_option("--sheet", inspect_options.sheet, "write a contact sheet")
      ->type_name("FILE.png");
  inspect_app.add_option("--ffmpeg", inspect_options.ffmpeg, "the program")->type_name("PATH");
  CLI::App& verify_app =
      add_path_command(program, "verify", "is a recording whole and readable", verify_options);
  verify_app.add_flag("--decode", verify_options.decode, "decode every frame");
  verify_app.add_option("--ffmpeg", verify_options.ffmpeg, "the program")->type_name("PATH");
  add_path_command(program, "repair", "publish what an interrupted recording has finished",
                   repair_options);

  bool list_json = false;
  const auto add_list = [&](const char* name, const char* help) -> CLI::App& {
    CLI::App& list = *program.add_subcommand(name, help);
    list.add_flag("--json", list_json, "as JSON");
    return list;
  };
  CLI::App& tasks = add_list("tasks", "the tasks there are, and what they need");
  CLI::App& robots = add_list("robots", "the robots there are");
  CLI::App& scenes = add_list("scenes", "the scenes there are, and what they need");

  CLI::App& schema =
      *program.add_subcommand("schema", "all configurations and their fields, as JSON");
  program.footer("Any other word runs mjsense-<word> from PATH.");  // no subcommand inherits it

  std::vector<std::string> known;
  for (const CLI::App* app : program.get_subcommands({})) known.push_back(app->get_name());
  if (argc < 2) {
    say("{}", program.help());
    return kWrongInput;
  }
  const std::string word = argv[1];
  if (word.starts_with('-')) {
    // The library would ask for a command first.
    const CLI::Option* option = program.get_option_no_throw(word);
    if (option == nullptr)
      throw ValueError(fmt::format("no option '{}' (mjsense --help shows how)", word));
  } else if (std::ranges::find(known, word) == known.end()) {
    run_external(word, argv + 1, known);
  }
  // Writing beyond ulimit -f, on stdout too, is an error of that write. (Another program, above, gets
  // its signals as we got them.)
  std::signal(SIGXFSZ, SIG_IGN);
  if (word == "record") read_config_argument(argc, argv, record_options);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return program.exit(e);  // --help, --version
    throw ValueError(fmt::format("{} (mjsense{} --help shows how)", e.what(),
                                 word.starts_with('-') ? "" : " " + word));
  }

  if (record.parsed()) return run_record(record_options);
  if (sensors.parsed()) {
    for (const CLI::Option* o : sensors.get_options())
      if (o->count() > 0) sensors_options.given.push_back(o->get_name());
    return run_sensors(sensors_options);
  }
  if (scan.parsed()) return run_scan(scan_options);
  if (tasks.parsed() || robots.parsed() || scenes.parsed()) {
    print(tasks.parsed()    ? list_tasks(list_json)
          : robots.parsed() ? list_robots(list_json)
                            : list_scenes(list_json));
    return 0;
  }
  if (schema.parsed()) {
    print(schema_json());
    return 0;
  }
  if (inspect_app.parsed()) {
    const InspectResult result = inspect(existing(inspect_options.path));
    // Before anything is printed: what cannot be drawn or written is one line.
    if (inspect_app.get_option("--sheet")->count() > 0)
      contact_sheet(inspect_options.path, inspect_options.sheet, 4, 8, inspect_options.ffmpeg);
    print(inspect_options.json ? result.json() : result.text());
    return 0;
  }
  if (verify_app.parsed()) {
    const VerifyResult result =
        verify(existing(verify_options.path), {verify_options.decode, verify_options.ffmpeg});
    print(verify_options.json ? result.json() : result.text());
    return result.ok() ? 0 : kFailed;
  }
  const RepairResult result = repair(existing(repair_options.path));
  print(repair_options.json ? result.json() : result.text());
  return result.failures.empty() ? 0 : kFailed;
}

}  // namespace

int run_program(int argc, char** argv) {
  try {
    const int code = run(argc, argv);
    // A full disk behind > is no success.
    if (std::fflush(stdout) != 0 || std::ferror(stdout))
      throw RuntimeError(fmt::format("cannot write to stdout: {}", std::strerror(errno)));
    return code;
  } catch (const std::exception& e) {
    std::string why = e.what();
    // fmt does not know which file it could not write to.
    if (const auto* of_fmt = dynamic_cast<const std::system_error*>(&e);
        of_fmt && std::ferror(stdout))
      why = "cannot write to stdout: " + of_fmt->code().message();
    // It may quote a file of a stranger's.
    constexpr std::size_t kMostBytes = 4000;
    if (why.size() > kMostBytes) why = why.substr(0, kMostBytes) + " ...";
    say("mjsense: {}\n", one_line(why));
    return kWrongInput;
  }
}

}  // namespace mjsense
