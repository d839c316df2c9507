// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/data_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/files/embedded_files.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEmbedded = "embedded:", kPackage = "package:";

}  // namespace

std::vector<std::string> DataFolder::names() const {
  std::vector<std::string> names;
  for (const EmbeddedFile& file : embedded_files()) {
    if (!file.name.starts_with(folder) || !file.name.ends_with(tail)) continue;
    const std::string_view name =
        file.name.substr(folder.size(), file.name.size() - folder.size() - tail.size());
    if (nested || name.find('/') == std::string_view::npos) names.emplace_back(name);
  }
  return names;
}

DataFile DataFolder::find(std::string_view name) const {
  const std::vector<std::string> known = names();
  if (std::ranges::find(known, name) != known.end()) {
    const std::string file = fmt::format("{}{}{}", folder, name, tail);
    return {fmt::format("{}{}", kEmbedded, file), std::string(embedded_file(file))};
  }
  if (!name.ends_with(".toml")) throw_unknown(fmt::format("{}s", kind), kind, name, known);
  if (name.starts_with(kEmbedded))
    return {std::string(name), std::string(embedded_file(name.substr(kEmbedded.size())))};
  const std::string path(name);
  std::string text = read_text_file(path);
  return {fs::absolute(path).lexically_normal().string(), std::move(text)};
}

std::string resolve_relative(std::string_view path, const std::string& name) {
  if (name.starts_with(kEmbedded) || name.starts_with(kPackage) || fs::path(name).is_absolute())
    return name;
  const bool embedded = path.starts_with(kEmbedded);
  const fs::path file = embedded ? path.substr(kEmbedded.size()) : path;
  const std::string joined = (file.parent_path() / name).lexically_normal().generic_string();
  return embedded ? std::string(kEmbedded) + joined : joined;
}

}  // namespace mjsense
