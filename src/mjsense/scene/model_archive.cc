// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_archive.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/files/zip.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

constexpr std::pair<std::string_view, char> kEscapes[] = {
    {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&amp;", '&'}};

std::string unescaped(std::string text) {
  for (const auto& [escape, character] : kEscapes) {
    for (std::size_t at = 0; (at = text.find(escape, at)) != std::string::npos; ++at)
      text.replace(at, escape.size(), 1, character);
  }
  return text;
}

// Whether the XML ends with the name of an attribute for files: file, fileback, filedown, filefront,
// fileleft, fileright or fileup.
bool is_file_attribute(std::string_view xml) {
  const std::string_view name = xml.substr(xml.find_last_of(" \t\n<") + 1);
  return name.starts_with("file");
}

std::string read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw RuntimeError(fmt::format("scene: cannot read '{}', which its model uses", path));
  return bytes;
}

}  // namespace

std::string model_archive(const Scene& scene) {
  const std::string xml = scene.to_xml();
  std::map<std::string, std::string> names;  // path on disk -> name in the archive
  std::string text;
  std::size_t copied = 0;
  constexpr std::string_view kAbsolute = "=\"/";
  for (std::size_t at = xml.find(kAbsolute); at != std::string::npos;
       at = xml.find(kAbsolute, at + 1)) {
    if (!is_file_attribute(std::string_view(xml).substr(0, at))) continue;
    const std::size_t begin = at + kAbsolute.size() - 1;
    const std::size_t end = xml.find('"', begin);
    const std::string path = unescaped(xml.substr(begin, end - begin));
    const auto [name, fresh] = names.emplace(path, "");
    if (fresh) {
      // Numbers distinguish files of equal names in different folders.
      name->second = "assets/" + std::to_string(names.size() - 1) +
                     std::filesystem::path(path).extension().string();
    }
    text.append(xml, copied, begin - copied);
    text += name->second;
    copied = end;
  }
  text.append(xml, copied);

  ZipWriter zip;
  zip.add(kArchivedModel, text);
  for (const auto& [path, name] : names) zip.add(name, read(path));
  for (const auto& [name, bytes] : scene.assets()) zip.add(name, bytes);
  return zip.finish();
}

}  // namespace mjsense::scene
