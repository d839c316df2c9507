// SPDX-License-Identifier: Apache-2.0
#pragma once
// Enumerations whose values have words, as members of configurations and in files.

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>

namespace mjsense {

// Words for the values of an enumeration that counts from 0. Declare them next to the enumeration, in
// its namespace:
//   constexpr std::array<std::string_view, 2> enum_names(Side) { return {"left", "right"}; }
// For an enumeration of MuJoCo, specialise kEnumNames.
template <class E>
inline constexpr std::nullptr_t kEnumNames = nullptr;
template <class E>
requires requires { enum_names(E{}); }
inline constexpr auto kEnumNames<E> = enum_names(E{});

template <class E>
concept HasEnumNames =
    std::is_enum_v<E> && !std::is_same_v<decltype(kEnumNames<E>), const std::nullptr_t>;

template <HasEnumNames E>
std::string_view enum_name(E value) {
  return kEnumNames<E>[static_cast<std::size_t>(value)];
}

// Index of `text` in `words`, ignoring case. Throws ValueError "sensor 'feet': reduce is 'max':
// must be one of none, mindist, maxforce, netforce; did you mean 'maxforce'?"
int enum_index(std::string_view text, std::span<const std::string_view> words,
               std::string_view context, std::string_view field);

// A member that holds one of the words: `cfg.reduce = ContactReduce::kNone` or `cfg.reduce =
// "none"`. An unknown word does not compile.
template <HasEnumNames E>
class NamedEnum {
 public:
  using Enum = E;
  constexpr NamedEnum() = default;
  constexpr NamedEnum(E value) : value_(value) {}  // NOLINT: implicit conversion is intended
  // NOLINT: implicit conversion is intended
  consteval NamedEnum(const char* text) : value_(find(text)) {}
  constexpr operator E() const { return value_; }  // NOLINT
  std::string_view text() const { return enum_name(value_); }
  friend constexpr bool operator==(NamedEnum a, NamedEnum b) { return a.value_ == b.value_; }
  friend constexpr bool operator==(NamedEnum a, E b) { return a.value_ == b; }

 private:
  static consteval E find(std::string_view text) {
    for (std::size_t i = 0; i < kEnumNames<E>.size(); ++i) {
      if (kEnumNames<E>[i] == text) return static_cast<E>(i);
    }
    throw "the word is not one of the allowed words";
  }
  E value_{};
};

template <HasEnumNames E>
E from_word(std::string_view text, std::string_view context, std::string_view field) {
  return static_cast<E>(enum_index(text, kEnumNames<E>, context, field));
}

}  // namespace mjsense
