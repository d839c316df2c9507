// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/completion.h"

#include <algorithm>
#include <string_view>

#include "mjsense/core/error.h"

namespace mjsense::app {
namespace {

constexpr const char* kBash = R"sh(# source <(mjsense completion bash)
_mjsense() {
  local IFS=$'\n'
  COMPREPLY=($(mjsense complete -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
complete -o default -F _mjsense mjsense
)sh";

constexpr const char* kZsh = R"sh(#compdef mjsense
# source <(mjsense completion zsh)
_mjsense() {
  local -a found
  found=(${(f)"$(mjsense complete -- "${(@)words[2,CURRENT]}" 2>/dev/null)"})
  if (( ${#found} )); then compadd -- $found; else _files; fi
}
compdef _mjsense mjsense
)sh";

constexpr const char* kFish = R"sh(# mjsense completion fish | source
function __mjsense_complete
    set -l words (commandline -opc) (commandline -ct)
    mjsense complete -- $words[2..-1] 2>/dev/null
end
complete -c mjsense -a '(__mjsense_complete)'
)sh";

// Option names as they are written: "--robot", "-q".
std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options({})) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& program) {
  std::vector<std::string> names;
  for (const CLI::App* sub : program.get_subcommands({}))
    if (!sub->get_group().empty()) names.push_back(sub->get_name());
  return names;
}

const CLI::App* command(const CLI::App& program, const std::string& name) {
  for (const CLI::App* sub : program.get_subcommands({}))
    if (sub->get_name() == name) return sub;
  return nullptr;
}

std::vector<std::string> values(const Choices& choices, const std::string& name) {
  const auto found = choices.find(name);
  return found == choices.end() ? std::vector<std::string>{} : found->second;
}

// Values of the positional argument at the position of the last word.
std::vector<std::string> positional_values(const CLI::App& app, const Choices& choices) {
  for (const CLI::Option* option : app.get_options({})) {
    if (option->get_positional()) return values(choices, option->get_name(true));
  }
  return {};
}

std::vector<std::string> candidates(const CLI::App& program, const Choices& choices,
                                    std::span<const std::string> words) {
  const std::string& last = words.back();
  if (words.size() == 1)
    return last.starts_with('-') ? option_names(program) : command_names(program);
  const CLI::App* app = command(program, words[0]);
  if (app == nullptr) return {};
  if (last.starts_with('-')) return option_names(*app);
  const std::string& before = words[words.size() - 2];
  if (before.starts_with('-')) {
    const CLI::Option* option = app->get_option_no_throw(before);
    if (option != nullptr && option->get_items_expected_max() > 0) return values(choices, before);
  }
  return positional_values(*app, choices);
}

}  // namespace

std::string completion_script(const std::string& shell) {
  if (shell == "bash") return kBash;
  if (shell == "zsh") return kZsh;
  if (shell == "fish") return kFish;
  throw_unknown("completion", "shell", shell, std::vector<std::string>{"bash", "zsh", "fish"});
}

std::vector<std::string> complete(const CLI::App& program, const Choices& choices,
                                  std::span<const std::string> words) {
  if (words.empty()) return {};
  std::vector<std::string> found = candidates(program, choices, words);
  std::erase_if(found, [&](const std::string& name) { return !name.starts_with(words.back()); });
  return found;
}

}  // namespace mjsense::app
