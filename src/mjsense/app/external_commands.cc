// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/external_commands.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense::app {
namespace {

constexpr std::string_view kPrefix = "mjsense-";

// Words for which PATH has a program.
std::vector<std::string> words_in_path() {
  std::vector<std::string> words;
  const char* path = std::getenv("PATH");
  const std::string_view folders = path ? path : "";
  for (std::size_t begin = 0; begin <= folders.size();) {
    const std::size_t end = std::min(folders.find(':', begin), folders.size());
    std::error_code ignored;
    for (const auto& entry :
         std::filesystem::directory_iterator(folders.substr(begin, end - begin), ignored)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(kPrefix) && access(entry.path().c_str(), X_OK) == 0) {
        words.push_back(name.substr(kPrefix.size()));
      }
    }
    begin = end + 1;
  }
  return words;
}

}  // namespace

void run_external(const std::string& word, char** arguments, std::span<const std::string> known,
                  std::string_view hint) {
  const std::string program = std::string(kPrefix) + word;
  execvp(program.c_str(), arguments);
  if (errno != ENOENT && errno != EACCES) {
    throw RuntimeError(fmt::format("{}: {}", program, std::strerror(errno)));
  }
  std::vector<std::string> names(known.begin(), known.end());
  for (std::string& name : words_in_path()) names.push_back(std::move(name));
  const std::string nearest = suggest(word, names);
  throw KeyError(fmt::format("no command '{}'{}", word, nearest.empty() ? hint : nearest));
}

}  // namespace mjsense::app
