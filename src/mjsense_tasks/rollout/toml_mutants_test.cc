// SPDX-License-Identifier: Apache-2.0
// Mutated robot and scene files. Each must either work up to the planner's first plan or be
// rejected with a message; it must neither crash nor hang. Every mutant runs in a child process
// with time limits.
//
// MJSENSE_MUTANTS=3300 runs that many random mutants, and every removed line of the scenes too.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>

#include "mjsense/core/error.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/scenes/load_scene.h"

namespace mjsense::tasks::rollout {
namespace {

constexpr DataFolder kRobots{"robot", "robots/", "/robot.toml"};
constexpr DataFolder kScenes{"scene", "scenes/", "/scene.toml", true};
constexpr rlim_t kProcessorSeconds = 30;  // CPU time per mutant; the unchanged files take 1 s
constexpr unsigned kSeconds = 300;        // wall-clock time, on a busy machine

int random_mutants() {
  const char* value = std::getenv("MJSENSE_MUTANTS");
  return value ? std::atoi(value) : 0;
}

// Loads a task with the robot and computes the planner's first plan.
void use(episode::TaskCfg cfg, bool plan) {
  set_task_defaults("pick", cfg);
  const std::unique_ptr<episode::Task> task = make_task("pick", cfg);
  const scene::Scene scene(task->scene_cfg_with_robot());
  task->initialize(scene.model(), 1);
  const std::unique_ptr<episode::Policy> policy = make_policy("planner");
  task->register_policy(*policy);
  if (!plan) return;
  const DataPtr data = make_data(scene.model());
  task->sample(0, 0, robots::state_row(data.get()));
  mj_forward(scene.model(), data.get());
  const World world{.id = 0, .model = scene.model(), .data = data.get()};
  task->begin(world);
  policy->reset(world);
}

// "" if `action` returns or throws an Error with a message; otherwise a description of what
// happened.
std::string outcome(const std::function<void()>& action) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit time{kProcessorSeconds, kProcessorSeconds + 1};
    setrlimit(RLIMIT_CPU, &time);
    alarm(kSeconds);
    int code = 0;
    try {
      action();
    } catch (const Error& e) {
      code = *e.what() ? 0 : 3;
    } catch (...) {
      code = 4;
    }
    _exit(code);
  }
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) != child) return "no child process";
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  if (WIFEXITED(status))
    return fmt::format("it ended with {}: 3 is an empty message, 4 a foreign exception",
                       WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  return signal == SIGXCPU || signal == SIGALRM ? "it does not end"
                                                : fmt::format("signal {}", signal);
}

std::string used_robot(const std::string& text, const std::string& path, bool plan) {
  return outcome([&] {
    episode::TaskCfg cfg;
    cfg.robot = robots::parse_robot(text, path);
    cfg.policy_dt_ms = cfg.robot.policy_dt_ms;
    cfg.ctrl_dt_ms = cfg.robot.ctrl_dt_ms;
    cfg.sim_dt_ms = cfg.robot.sim_dt_ms;
    use(cfg, plan);
  });
}

std::string used_scene(const std::string& text, const std::filesystem::path& file) {
  std::ofstream(file) << text;
  return outcome([&] { use(episode::task_cfg("franka", file.string()), false); });
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    lines.push_back(text.substr(at, end - at));
    at = end;
  }
  return lines;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line;
  return text;
}

std::string without(std::vector<std::string> lines, std::size_t line) {
  lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(line));
  return joined(lines);
}

bool says_something(const std::string& line) { return line != "\n" && !line.starts_with("#"); }

class RobotMutants : public ::testing::TestWithParam<std::string> {};

TEST_P(RobotMutants, RemovedLinesNeitherCrashNorHang) {
  const DataFile file = kRobots.find(GetParam());
  const std::vector<std::string> lines = lines_of(file.text);
  ASSERT_EQ(used_robot(file.text, file.path, true), "");
  const std::size_t stride = random_mutants() > 0 ? 1 : 3;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!says_something(lines[i]) || i % stride != 0) continue;
    EXPECT_EQ(used_robot(without(lines, i), file.path, random_mutants() > 0), "")
        << file.path << " without line " << i + 1 << ": " << lines[i];
  }
}
INSTANTIATE_TEST_SUITE_P(Robots, RobotMutants, ::testing::ValuesIn(robots::robot_names()),
                         [](const auto& info) { return info.param; });

// Models referenced relative to the file are not found from the copy. That is one of the faults.
TEST(SceneMutants, RemovedLinesNeitherCrashNorHang) {
  const mjsense::testing::TempDir folder;
  const std::filesystem::path copy = folder.path / "scene.toml";
  const std::size_t stride = random_mutants() > 0 ? 1 : 40;
  std::size_t count = 0;
  for (const std::string& name : scenes::scene_names()) {
    const DataFile file = kScenes.find(name);
    const std::vector<std::string> lines = lines_of(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!says_something(lines[i]) || ++count % stride != 0) continue;
      EXPECT_EQ(used_scene(without(lines, i), copy), "")
          << file.path << " without line " << i + 1 << ": " << lines[i];
    }
  }
}

// Duplicates a line, swaps two lines, or changes a digit or a letter.
std::string mutate(std::vector<std::string> lines, Rng& rng) {
  const auto draw = [&](std::size_t n) { return rng.below(static_cast<std::uint32_t>(n)); };
  const std::size_t changes = 1 + draw(3);
  for (std::size_t k = 0; k < changes; ++k) {
    std::string& line = lines[draw(lines.size())];
    switch (draw(5)) {
      case 0:
        lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(draw(lines.size())),
                     std::string(line));
        break;
      case 1:
        std::swap(line, lines[draw(lines.size())]);
        break;
      case 2:
        line[draw(line.size())] = static_cast<char>(' ' + draw(95));
        break;
      case 3: {
        static constexpr const char* kNumbers[] = {"-1", "0", "1e300", "nan", "inf", "99999999999"};
        const std::size_t digit = line.find_first_of("0123456789");
        if (digit != std::string::npos)
          line.replace(digit, line.find_first_not_of("0123456789.", digit) - digit,
                       kNumbers[draw(std::size(kNumbers))]);
        break;
      }
      default: {
        const std::size_t open = line.find('"'), close = line.rfind('"');
        if (open < close) line.replace(open + 1, close - open - 1, draw(2) ? "" : "other");
      }
    }
  }
  return joined(lines);
}

TEST(RandomRobotMutants, NeitherCrashNorHang) {
  const std::vector<std::string> names = robots::robot_names();
  const int mutants = random_mutants() > 0 ? random_mutants() : 40;
  for (int i = 0; i < mutants; ++i) {
    Rng rng(7, static_cast<std::uint32_t>(i), stream_of("toml mutants"), 0);
    const DataFile file = kRobots.find(names[static_cast<std::size_t>(i) % names.size()]);
    const std::string text = mutate(lines_of(file.text), rng);
    EXPECT_EQ(used_robot(text, file.path, false), "") << "mutant " << i << ":\n" << text;
  }
}

}  // namespace
}  // namespace mjsense::tasks::rollout
