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

#include "mjsense/app/completion.h"
#include "mjsense/app/external_commands.h"
#include "mjsense/app/field_options.h"
#include "mjsense/app/help.h"
#include "mjsense/app/list_command.h"
#include "mjsense/app/progress.h"
#include "mjsense/app/record_command.h"
#include "mjsense/app/scan_command.h"
#include "mjsense/app/schema.h"
#include "mjsense/app/sensors_command.h"
#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/print_stderr.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/scenes/load_scene.h"

namespace mjsense::app {
namespace {

constexpr int kFailed = 1;
constexpr int kWrongInput = 2;

// Lists the names that the option accepts, after its description.
void list_names(CLI::Option* option, const std::vector<std::string>& names) {
  option->description(
      fmt::format("{} One of: {}.", option->get_description(), fmt::join(names, ", ")));
}

void list_names(CLI::App& app) {
  list_names(app.get_option("--robot"), tasks::robots::robot_names());
  list_names(app.get_option("--policy"), tasks::rollout::policy_names());
}

// Throws if the words that the command did not expect include an option.
void throw_unknown_option(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  for (const std::string& word : command.remaining()) {
    if (const std::string name = word.substr(0, word.find('=')); name.starts_with("--"))
      throw_unknown(command.get_name(), "option", name, names);
  }
}

Choices choices() {
  Choices choices;
  add_choices(struct_of<tasks::rollout::RecordJobCfg>(), choices);
  add_choices(struct_of<sensors::LidarSensorCfg>(), choices);
  choices["--robot"] = tasks::robots::robot_names();
  choices["--policy"] = tasks::rollout::policy_names();
  choices["--scene"] = tasks::scenes::scene_names();
  choices["task"] = choices["what"] = tasks::rollout::task_names();
  choices["shell"] = {"bash", "zsh", "fish"};
  return choices;
}

CLI::App& add_record(CLI::App& program, RecordOptions& options) {
  CLI::App& app = *program.add_subcommand("record", "Record episodes of a task.");
  list_names(app.add_option("task", options.job.rollout.task, "Name of the task.")
                 ->capture_default_str()
                 ->type_name("TASK"),
             tasks::rollout::task_names());
  add_field_options(app, struct_of<tasks::rollout::RecordJobCfg>(), &options.job, {"task"});
  add_set_options(app, struct_of<tasks::rollout::RecordJobCfg>(), &options.job);
  list_names(app);
  app.add_option("--config",
                 "TOML file with these options; options on the command line take precedence.")
      ->type_name("FILE");
  app.add_flag_callback(
      "--no-sheet", [&options] { options.sheet = false; }, "Do not write a contact sheet.");
  app.add_flag_callback(
         "--no-tree", [&options] { options.tree = false; }, "Do not print the tree of the files.")
      ->group("");
  // Options of the Python package, which handles a command with --ray or --format itself.
  const auto add_python = [&](const char* name, const char* type, const char* help) {
    app.add_option_function<std::string>(
           name,
           [name](const std::string&) {
             throw ValueError(fmt::format(
                 "{} needs the Python package, and --ray or --format: run python -m mjsense record",
                 name));
           },
           help)
        ->type_name(type);
  };
  add_python("--ray", "ADDRESS",
             "Record on a Ray cluster: local (the CPUs of this machine), auto, or its address.");
  add_python("--shard-attempts", "N",
             "With --ray: attempts of one task of the cluster; default 16.");
  add_python("--ray-working-dir", "DIR",
             "With --ray: directory with your code, sent to the workers.");
  add_python("--ray-pip", "NAMES",
             "With --ray: Python packages that workers install, separated by commas.");
  add_python("--format", "FORMAT", "lerobot: write a LeRobot data set (v3.0) instead of HDF5.");
  add_python("--map", "FILE", "With --format: TOML file that chooses features and cameras.");
  auto add_python_flag = [&](const char* name, const char* help) {
    app.add_flag_callback(
        name,
        [name] {
          throw ValueError(fmt::format(
              "{} needs the Python package and --format: run python -m mjsense record", name));
        },
        help);
  };
  add_python_flag("--trim-idle", "With --format: leave out the steps in which nothing moves.");
  add_python_flag("--no-trim-idle",
                  "With --format: keep these steps in episodes whose task places an object too.");
  add_python_flag("--keep-recording", "With --format: keep the recording itself too.");
  app.add_flag("--json", options.json, "Print the summary as JSON.");
  app.add_flag("-q,--quiet", options.quiet, "Print nothing but errors.");
  add_examples(app, {{"mjsense record pick --episodes 8 --worlds 4 --out data",
                      "Record eight episodes of the task pick, four at a time."},
                     {"mjsense record open --scene kitchen:7 --robot rby1 --depth --out data",
                      "Open something in kitchen number 7 with RB-Y1, and record depth too."}});
  return app;
}

// Checks that do not change the help, which shows the name of the type and the default.
CLI::Validator existing_file() { return CLI::Validator(CLI::ExistingFile).description(""); }
CLI::Validator number_of_steps() { return CLI::Range(0, 1'000'000'000).description(""); }

CLI::App& add_sensors(CLI::App& program, SensorsOptions& options) {
  CLI::App& app = *program.add_subcommand(
      "sensors", "List the sensors of a scene or task: shapes, units, frames and cost.");
  list_names(
      app.add_option("what", options.what, "An MJCF file, embedded:FILE, or the name of a task.")
          ->required()
          ->type_name("SCENE.xml|TASK"),
      tasks::rollout::task_names());
  add_field_options(app, struct_of<tasks::rollout::RolloutCfg>(), &options.rollout,
                    {"task", "worlds"});
  add_set_options(app, struct_of<tasks::rollout::RolloutCfg>(), &options.rollout);
  list_names(app);
  app.add_option("--steps", options.steps,
                 "Number of steps over which the cost is measured; 0: do not measure.")
      ->capture_default_str()
      ->check(number_of_steps());
  app.add_flag("--json", options.json, "Print JSON.");
  add_examples(app, {{"mjsense sensors embedded:robots/quadruped.xml",
                      "List the sensors of a model that mjsense includes."},
                     {"mjsense sensors pick --robot franka --steps 0",
                      "List what a recording of a task contains, without measuring the cost."}});
  return app;
}

CLI::App& add_scan(CLI::App& program, ScanOptions& options) {
  CLI::App& app =
      *program.add_subcommand("scan", "Write the point cloud that a lidar measures in a scene.");
  app.add_option("scene", options.scene, "An MJCF file, or embedded:FILE.")
      ->required()
      ->type_name("SCENE.xml");
  app.add_option("--frame", options.frame,
                 "The frame that carries the lidar: site:NAME, body:NAME, ...")
      ->required()
      ->type_name("TYPE:NAME");
  app.add_option("--out", options.out, "Output file, .ply or .pcd.")->required()->type_name("FILE");
  // The scene does not move, so the rate of a scan and motion distortion have no effect.
  add_field_options(app, struct_of<sensors::TableScan>(), &options.table, {"rate-hz"});
  CLI::Option* table = app.get_option("--table")->check(existing_file())->type_name("FILE.npy");
  app.get_option("--rays")->needs(table);
  const std::size_t others = app.get_options().size();
  add_field_options(app, struct_of<sensors::SpinningScan>(), &options.spinning, {"rate-hz"});
  const std::vector<CLI::Option*> all = app.get_options({});
  for (std::size_t i = others; i < all.size(); ++i) all[i]->excludes(table);
  add_field_options(app, struct_of<sensors::LidarSensorCfg>(), &options.lidar,
                    {"name", "any-frame", "debug-vis", "hit-ids", "motion-distortion"});
  app.add_option("--steps", options.steps, "Number of physics steps before the scan.")
      ->capture_default_str()
      ->check(number_of_steps());
  app.add_flag("--world", options.world,
               "Write the points in the world frame instead of the lidar's frame.");
  add_examples(
      app,
      {{"mjsense scan embedded:scenes/table/room.xml --frame geom:table_top --out cloud.ply",
        "Scan a room from its table."},
       {"mjsense scan scene.xml --frame site:lidar --channels 32 --samples 1024 --out cloud.pcd",
        "Scan with 32 lasers and 1,024 firings per sweep."}});
  return app;
}

struct PathOptions {
  std::string path, sheet, ffmpeg;
  bool json = false, decode = false, quiet = false;
};

CLI::App& add_path_command(CLI::App& program, const char* name, const char* help,
                           PathOptions& options) {
  CLI::App& app = *program.add_subcommand(name, help);
  app.add_option("path", options.path, "A recording, a house_N folder or an .h5 file.")->required();
  app.add_flag("--json", options.json, "Print JSON.");
  return app;
}

// MuJoCo's messages may have several lines.
std::string one_line(std::string text) {
  text.erase(text.find_last_not_of(" \n") + 1);
  for (std::size_t at; (at = text.find('\n')) != std::string::npos;) text.replace(at, 1, "; ");
  return text;
}

// Prints each warning of MuJoCo once, on stderr, and writes no log file. Divergence is not printed:
// it is reported with its episode.
void show_warnings() {
  mju_user_warning = [](const char* text) {
    static std::mutex mutex;
    static std::set<std::string> shown;
    const std::string warning = text;
    if (warning.find("simulation is unstable") != std::string::npos) return;
    const std::lock_guard lock(mutex);
    if (shown.insert(warning).second) print_stderr("mjsense: MuJoCo: {}\n", one_line(warning));
  };
}

const std::string& existing(const std::string& path) {
  if (!std::filesystem::exists(path))
    throw ValueError((path.empty() ? "''" : path) + ": no such file or directory");
  return path;
}

void print(const std::string& text) { fmt::print("{}{}", text, text.ends_with('\n') ? "" : "\n"); }

// Reads --config before the command line is parsed, because options of the command line take
// precedence.
void read_config_argument(int argc, char** argv, RecordOptions& options) {
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--config" && i + 1 < argc)
      read_toml(argv[i + 1], struct_of<tasks::rollout::RecordJobCfg>(), &options.job);
    if (word.starts_with("--config="))
      read_toml(word.substr(9), struct_of<tasks::rollout::RecordJobCfg>(), &options.job);
  }
}

int run(int argc, char** argv, std::span<const OtherCommand> others) {
  show_warnings();
  scene::disable_mujoco_log_file();
  CLI::App program("Sensors, cameras and recordings for MuJoCo simulations.", "mjsense");
  set_help_format(program);
  program.set_version_flag("--version", "mjsense " MJSENSE_VERSION, "Print the version and exit.");
  program.require_subcommand(1);

  RecordOptions record_options;
  SensorsOptions sensors_options;
  ScanOptions scan_options;
  PathOptions inspect_options, verify_options, repair_options;
  CLI::App& record = add_record(program, record_options);
  CLI::App& sensors = add_sensors(program, sensors_options);
  CLI::App& scan = add_scan(program, scan_options);
  CLI::App& inspect_app = add_path_command(
      program, "inspect", "Show the contents and statistics of a recording.", inspect_options);
  inspect_app.add_option("--sheet", inspect_options.sheet, "Write a contact sheet of the videos.")
      ->type_name("FILE.png");
  inspect_app.add_option("--ffmpeg", inspect_options.ffmpeg, "Path of the ffmpeg program.")
      ->type_name("PATH");
  // The Python package handles a command with this option itself.
  inspect_app.add_flag_callback(
      "--quality",
      [] { throw ValueError("--quality needs the Python package: run python -m mjsense inspect"); },
      "Show how each episode was performed too: idle share, jerk, approach, visibility.");
  CLI::App& verify_app = add_path_command(
      program, "verify", "Check that a recording is complete and undamaged.", verify_options);
  verify_app.add_flag("--decode", verify_options.decode, "Decode every frame of the videos.");
  verify_app.add_flag("-q,--quiet", verify_options.quiet, "Print nothing but errors.");
  verify_app.add_option("--ffmpeg", verify_options.ffmpeg, "Path of the ffmpeg program.")
      ->type_name("PATH");
  CLI::App& repair_app = add_path_command(
      program, "repair", "Publish the finished episodes of an interrupted recording.",
      repair_options);
  add_examples(inspect_app,
               {{"mjsense inspect data", "Show what a recording contains."},
                {"mjsense inspect data --sheet sheet.png", "Write a picture of every camera too."},
                {"mjsense inspect data --quality", "Show how each episode was performed too."}});
  add_examples(verify_app, {{"mjsense verify data", "Check all checksums."},
                            {"mjsense verify --decode data", "Decode every video frame too."}});
  add_examples(repair_app, {{"mjsense repair data",
                             "Publish the finished episodes of an interrupted recording."},
                            {"mjsense repair --json data/house_0", "Print the result as JSON."}});

  bool list_json = false;
  const auto add_list = [&](const char* name, const char* help) -> CLI::App& {
    CLI::App& list = *program.add_subcommand(name, help);
    list.add_flag("--json", list_json, "Print JSON.");
    add_examples(list, {{fmt::format("mjsense {}", name), "Print the list."},
                        {fmt::format("mjsense {} --json", name), "Print the list as JSON."}});
    return list;
  };
  CLI::App& tasks = add_list("tasks", "List the tasks and what they need.");
  CLI::App& robots = add_list("robots", "List the robots.");
  CLI::App& scenes = add_list("scenes", "List the scenes and what they need.");
  CLI::App& objects =
      add_list("objects", "List the objects for scenes, their source and their licence.");

  CLI::App& schema =
      *program.add_subcommand("schema", "Print all configurations and their fields as JSON.");
  add_examples(schema,
               {{"mjsense schema > schema.json", "Keep the schema in a file."},
                {"mjsense schema | python -m json.tool | less", "Page through the schema."}});

  std::string shell;
  CLI::App& completion = *program.add_subcommand("completion", "Print a shell completion script.");
  completion.add_option("shell", shell, "bash, zsh or fish.")->required()->type_name("SHELL");
  add_examples(
      completion,
      {{"source <(mjsense completion bash)",
        "Enable completion in this shell; to enable it permanently, add the line to ~/.bashrc."},
       {"mjsense completion fish > ~/.config/fish/completions/mjsense.fish",
        "Enable completion in fish."}});
  // Run by the shells' scripts.
  std::vector<std::string> to_complete;
  CLI::App& complete_app = *program.add_subcommand("complete", "")->group("");
  complete_app.add_option("words", to_complete);

  for (const OtherCommand& other : others) program.add_subcommand(other.name, other.description);

  // Set last, because subcommands inherit the footer.
  program.footer(
      "Use `mjsense COMMAND --help` for the options of a command.\n"
      "An unknown COMMAND runs the program mjsense-COMMAND from PATH.");

  std::vector<std::string> known;
  for (const CLI::App* app : program.get_subcommands({}))
    if (!app->get_group().empty()) known.push_back(app->get_name());
  if (argc < 2) {
    print_stderr("{}", program.help());
    return kWrongInput;
  }
  if (argv[1] == std::string_view("help")) {  // "help record" is "record --help"
    static char option[] = "--help";
    std::rotate(argv + 1, argv + 2, argv + argc);
    argv[argc - 1] = option;
  }
  const std::string word = argv[1];
  if (word.starts_with('-')) {
    // CLI11 would report a missing command first.
    const CLI::Option* option = program.get_option_no_throw(word);
    if (option == nullptr)
      throw ValueError(fmt::format("no option '{}'; see mjsense --help", word));
  } else if (word != "complete" && std::ranges::find(known, word) == known.end()) {
    run_external(
        word, argv + 1, known,
        others.empty() ? "; the Python package has more commands: python -m mjsense --help" : "");
  }
  // Writing beyond ulimit -f must fail instead of killing the process. Programs that run_external()
  // starts keep the default.
  std::signal(SIGXFSZ, SIG_IGN);
  if (word == "record") read_config_argument(argc, argv, record_options);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return program.exit(e);  // --help, --version
    for (const CLI::App* command : program.get_subcommands()) throw_unknown_option(*command);
    throw ValueError(
        fmt::format("{}; see mjsense{} --help", e.what(), word.starts_with('-') ? "" : " " + word));
  }

  if (record.parsed()) return run_record(record_options);
  if (sensors.parsed()) {
    for (const CLI::Option* o : sensors.get_options())
      if (o->count() > 0) sensors_options.given.push_back(o->get_name());
    return run_sensors(sensors_options);
  }
  if (scan.parsed()) return run_scan(scan_options);
  if (tasks.parsed() || robots.parsed() || scenes.parsed() || objects.parsed()) {
    print(tasks.parsed()    ? list_tasks(list_json)
          : robots.parsed() ? list_robots(list_json)
          : scenes.parsed() ? list_scenes(list_json)
                            : list_objects(list_json));
    return 0;
  }
  if (completion.parsed()) {
    print(completion_script(shell));
    return 0;
  }
  if (complete_app.parsed()) {
    for (const std::string& found : complete(program, choices(), to_complete)) print(found);
    return 0;
  }
  if (schema.parsed()) {
    print(schema_json());
    return 0;
  }
  if (inspect_app.parsed()) {
    const replay::InspectResult result = replay::inspect(existing(inspect_options.path));
    // Before anything is printed, so that a failure prints one line only.
    if (inspect_app.get_option("--sheet")->count() > 0)
      replay::contact_sheet(inspect_options.path, inspect_options.sheet, 4, 8,
                            inspect_options.ffmpeg);
    print(inspect_options.json ? result.json() : result.text());
    return 0;
  }
  if (verify_app.parsed()) {
    const replay::VerifyResult result = [&] {
      StatusLine line(verify_options.quiet);
      return replay::verify(existing(verify_options.path),
                            {.decode = verify_options.decode,
                             .ffmpeg = verify_options.ffmpeg,
                             .progress = [&](const std::string& text) { line.show(text); }});
    }();
    if (!verify_options.quiet || verify_options.json || !result.ok())
      print(verify_options.json ? result.json() : result.text());
    return result.ok() ? 0 : kFailed;
  }
  const replay::RepairResult result = replay::repair(existing(repair_options.path));
  print(repair_options.json ? result.json() : result.text());
  return result.failures.empty() ? 0 : kFailed;
}

}  // namespace

int run_program(int argc, char** argv, std::span<const OtherCommand> others) {
  try {
    const int code = run(argc, argv, others);
    // Output that was redirected to a full disk is an error.
    if (std::fflush(stdout) != 0 || std::ferror(stdout))
      throw RuntimeError(fmt::format("cannot write to stdout: {}", std::strerror(errno)));
    return code;
  } catch (const std::exception& e) {
    std::string why = e.what();
    // The error of fmt does not say which file it could not write to.
    if (const auto* of_fmt = dynamic_cast<const std::system_error*>(&e);
        of_fmt && std::ferror(stdout))
      why = "cannot write to stdout: " + of_fmt->code().message();
    // The message may quote a file of any size.
    constexpr std::size_t kMaxBytes = 4000;
    if (why.size() > kMaxBytes) why = why.substr(0, kMaxBytes) + " ...";
    print_stderr("mjsense: {}\n", one_line(why));
    return kWrongInput;
  }
}

}  // namespace mjsense::app
