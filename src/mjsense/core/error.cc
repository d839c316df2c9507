// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/error.h"

#include <fmt/format.h>

#include <algorithm>

namespace mjsense {
namespace {

// Edit distance in which a transposition counts as one edit and a change of case costs less.
int distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<int>> d(a.size() + 1, std::vector<int>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = 2 * static_cast<int>(i);
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = 2 * static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool same = a[i - 1] == b[j - 1];
      const bool same_letter = std::tolower(a[i - 1]) == std::tolower(b[j - 1]);
      d[i][j] = std::min({d[i - 1][j] + 2, d[i][j - 1] + 2,
                          d[i - 1][j - 1] + (same          ? 0
                                             : same_letter ? 1
                                                           : 2)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 2);
      }
    }
  }
  return d[a.size()][b.size()];
}

bool same_without_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

}  // namespace

std::vector<std::string> nearest_names(std::string_view name,
                                       std::span<const std::string> candidates,
                                       std::size_t maximum) {
  // Longer names are not misspelt names, and time and memory grow with the square of the length.
  constexpr std::size_t kMaxBytes = 256;
  std::vector<std::pair<int, std::string>> scored;
  for (const std::string& c : candidates) {
    if (name.size() > kMaxBytes || c.size() > kMaxBytes) continue;
    int d = distance(name, c);
    // A name with an additional prefix, or one without its prefix, also counts as near.
    if (!name.empty() && c.size() > name.size() && c.ends_with(name)) d = 2;
    if (!c.empty() && name.size() > c.size() && name.ends_with(c)) d = 2;
    if (same_without_case(name, c)) d = std::min(d, 1);
    if (d <= static_cast<int>(std::max<std::size_t>(2, 2 * std::max(name.size(), c.size()) / 3))) {
      scored.emplace_back(d, c);
    }
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](auto& a, auto& b) { return a.first < b.first; });
  std::vector<std::string> names;
  for (auto& [d, c] : scored) {
    if (names.size() == maximum) break;
    if (std::find(names.begin(), names.end(), c) == names.end()) names.push_back(c);
  }
  return names;
}

std::string suggest(std::string_view name, std::span<const std::string> candidates) {
  const auto near = nearest_names(name, candidates);
  if (!near.empty()) {
    std::string text = "; did you mean ";
    for (std::size_t i = 0; i < near.size(); ++i) {
      text += fmt::format("{}'{}'", i == 0 ? "" : i + 1 == near.size() ? " or " : ", ", near[i]);
    }
    return text + "?";
  }
  if (candidates.empty()) return "";
  constexpr std::size_t kMax = 12;
  const auto shown = candidates.first(std::min(candidates.size(), kMax));
  return fmt::format("; available: {}{}", fmt::join(shown, ", "),
                     candidates.size() > kMax ? ", ..." : "");
}

void throw_unknown(std::string_view context, std::string_view kind, std::string_view name,
                   std::span<const std::string> candidates) {
  throw KeyError(
      fmt::format("{}: no {} named '{:.300}'{}", context, kind, name, suggest(name, candidates)));
}

}  // namespace mjsense
