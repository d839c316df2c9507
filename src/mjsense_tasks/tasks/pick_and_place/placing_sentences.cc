// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick_and_place/placing_sentences.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "mjsense_tasks/scenes/object_references.h"

namespace mjsense::tasks {
namespace {

// {0}: the object, {1}: where it is put ("next to the plate"), {2}: where it is moved to ("into the
// box").
constexpr std::array<const char*, 14> kSentences{
    "Pick up {0} and place it {1}",
    "Put {0} {1}",
    "Place {0} {1}",
    "Move {0} {2}",
    "Take {0} and put it {1}",
    "Grab {0} and set it down {1}",
    "Lift {0} and put it {1}",
    "Bring {0} over and set it down {1}",
    "Please put {0} {1}",
    "Can you put {0} {1}?",
    "Could you place {0} {1}, please?",
    "I want {0} to be {1}",
    "Pick up {0}, then put it {1}",
    "Please move {0} {2}",
};
// Receptacles by the last word of their names: things are put in them or on them.
constexpr std::array<std::string_view, 10> kInside{"bowl", "box", "basket", "pan", "pot",
                                                   "cup",  "mug", "bin",    "jar", "crate"};
constexpr std::array<std::string_view, 5> kOnTop{"plate", "tray", "board", "coaster", "book"};

}  // namespace

std::size_t num_placing_sentences() { return kSentences.size(); }

std::string placing_sentence(std::size_t index, PlaceKind kind, const std::string& object,
                             const std::string& where, const scenes::SceneObject& receptacle) {
  const auto is_any = [name = std::string_view(receptacle.text)](const auto& of) {
    return std::ranges::any_of(of, [&](auto word) { return scenes::may_be_called(name, word); });
  };
  std::string at = "in or on ", to = "in or on ";
  if (kind == PlaceKind::kNextTo) {
    at = to = "next to ";
  } else if (kind == PlaceKind::kPacking || is_any(kInside)) {
    at = "in ", to = "into ";
  } else if (is_any(kOnTop)) {
    at = "on ", to = "onto ";
  }
  return fmt::format(fmt::runtime(kSentences[index]), object, at + where, to + where);
}

}  // namespace mjsense::tasks
