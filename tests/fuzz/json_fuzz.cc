// SPDX-License-Identifier: Apache-2.0
// Fuzz target for JSON rows and for the JSON description of a recording. Results must agree with
// another parser (nlohmann::json) where both apply.

#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/replay/json_text.h"
#include "tests/fuzz/fuzz.h"

namespace {

constexpr const char* kRecording =
    R"({"batches":1,"episodes":4,"settings":{"task":"pick","seed":0},"streams":[{"place":"rewards"}]})";

int depth_of(std::string_view text) {
  int depth = 0, maximum = 0;
  for (const char c : text) {
    depth += (c == '[' || c == '{') - (c == ']' || c == '}');
    maximum = std::max(maximum, depth);
  }
  return maximum;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mjsense;
  const std::string text(reinterpret_cast<const char*>(data), size);
  std::size_t numbers = 0;
  const std::string wrong = replay::parse_json(text, [&](const std::string& path, double) {
    if (path.size() > text.size()) fuzz::broken("paths are no longer than the text", path);
    ++numbers;
  });
  if (numbers > size) fuzz::broken("every number takes at least one byte", text);
  // Our parser accepts NaN and Infinity, as Python does, and does not check the encoding of
  // strings. The other parser ends at a NUL.
  const bool accepted = nlohmann::json::accept(text);
  const bool odd = text.find('\0') != std::string::npos || text.starts_with("\xEF\xBB\xBF");
  if (accepted && !wrong.empty() && depth_of(text) < 60 && !odd)
    fuzz::broken("valid JSON is accepted", wrong + " in " + text);
  const bool ascii = std::all_of(text.begin(), text.end(), [](char c) { return (c & 0x80) == 0; });
  const bool plain = ascii && text.find_first_of("NI\\") == std::string::npos;
  if (!accepted && wrong.empty() && plain) {
    // A number beyond the range of double is infinite here and an error in the other parser.
    try {
      static_cast<void>(nlohmann::json::parse(text));
    } catch (const nlohmann::json::out_of_range&) {
      return 0;
    } catch (const nlohmann::json::exception& e) {
      fuzz::broken("invalid JSON is rejected", e.what() + (" in " + text));
    }
  }
  // Comparison of two descriptions of a recording, one of which comes from a file.
  for (const auto& [was, now] :
       {std::pair<std::string, std::string>{text, kRecording}, {kRecording, text}}) {
    try {
      const std::string difference = record::fingerprint_difference(was, now);
      if (difference.empty() && was != now &&
          nlohmann::json::parse(was, nullptr, false) != nlohmann::json::parse(now, nullptr, false))
        fuzz::broken("different descriptions give a difference", text);
    } catch (const Error&) {
    }
  }
  return 0;
}
