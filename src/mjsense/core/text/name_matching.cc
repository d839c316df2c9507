// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/text/name_matching.h"

#define PCRE2_CODE_UNIT_WIDTH 8
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pcre2.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/text/pattern_subset.h"

namespace mjsense {

struct Regex::Code {
  pcre2_code* code = nullptr;
  ~Code() { pcre2_code_free(code); }

  bool match(std::string_view text, std::uint32_t options, const std::string& pattern) const {
    std::unique_ptr<pcre2_match_data, void (*)(pcre2_match_data*)> data(
        pcre2_match_data_create(1, nullptr), pcre2_match_data_free);
    const int rc = pcre2_match(code, reinterpret_cast<PCRE2_SPTR>(text.data()), text.size(), 0,
                               options, data.get(), nullptr);
    if (rc >= 0) return true;
    if (rc == PCRE2_ERROR_NOMATCH) return false;
    PCRE2_UCHAR message[256];
    pcre2_get_error_message(rc, message, sizeof message);
    throw RuntimeError(fmt::format("regular expression '{}' on '{}': {}", pattern, text,
                                   reinterpret_cast<char*>(message)));
  }
};

Regex::Regex(std::string_view pattern, std::string_view context)
    : pattern_(pattern), code_(std::make_unique<Code>()) {
  const auto fault = [&](std::string_view what) {
    return ValueError(
        fmt::format("{}: '{}' is not a regular expression: {}", context, pattern, what));
  };
  try {
    check_pattern_subset(pattern);
  } catch (const ValueError& error) {
    throw fault(error.what());
  }
  int error = 0;
  PCRE2_SIZE offset = 0;
  std::unique_ptr<pcre2_compile_context, void (*)(pcre2_compile_context*)> compile_context(
      pcre2_compile_context_create(nullptr), pcre2_compile_context_free);
  pcre2_set_newline(compile_context.get(), PCRE2_NEWLINE_LF);
  code_->code = pcre2_compile(reinterpret_cast<PCRE2_SPTR>(pattern.data()), pattern.size(),
                              PCRE2_UTF | PCRE2_MATCH_INVALID_UTF | PCRE2_UCP, &error, &offset,
                              compile_context.get());
  if (!code_->code) {
    PCRE2_UCHAR message[256];
    pcre2_get_error_message(error, message, sizeof message);
    throw fault(fmt::format("{} at position {}", reinterpret_cast<char*>(message), offset));
  }
}

Regex::~Regex() = default;
Regex::Regex(Regex&&) noexcept = default;
Regex& Regex::operator=(Regex&&) noexcept = default;

bool Regex::fullmatch(std::string_view text) const {
  return code_->match(text, PCRE2_ANCHORED | PCRE2_ENDANCHORED, pattern_);
}

bool Regex::search(std::string_view text) const { return code_->match(text, 0, pattern_); }

std::vector<int> match_names(std::span<const std::string> patterns,
                             std::span<const std::string> names, std::string_view context) {
  std::vector<Regex> regexes;
  for (const std::string& pattern : patterns) regexes.emplace_back(pattern, context);
  std::vector<int> found;
  std::vector<bool> used(patterns.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    int by = -1;
    for (std::size_t k = 0; k < regexes.size(); ++k) {
      if (!regexes[k].fullmatch(names[i])) continue;
      used[k] = true;
      if (by >= 0) {
        throw ValueError(fmt::format("{}: Multiple matches for '{}': the patterns '{}' and '{}'",
                                     context, names[i], patterns[by], patterns[k]));
      }
      by = static_cast<int>(k);
    }
    if (by >= 0) found.push_back(static_cast<int>(i));
  }
  for (std::size_t k = 0; k < patterns.size(); ++k) {
    if (!used[k]) {
      throw ValueError(
          fmt::format("{}: Not all regular expressions are matched: '{}' matches no name{}",
                      context, patterns[k], suggest(patterns[k], names)));
    }
  }
  return found;
}

bool is_regex(std::string_view text) {
  return text.find_first_of(".*+?[]{}()\\|^$") != std::string_view::npos;
}

Exclude::Exclude(std::span<const std::string> entries, std::string_view context) {
  for (const std::string& entry : entries) {
    if (is_regex(entry)) {
      search_.emplace_back(entry, context);
    } else {
      exact_.push_back(entry);
    }
  }
}

bool Exclude::drops(std::string_view name) const {
  return std::find(exact_.begin(), exact_.end(), name) != exact_.end() ||
         std::any_of(search_.begin(), search_.end(),
                     [&](const Regex& regex) { return regex.search(name); });
}

}  // namespace mjsense
