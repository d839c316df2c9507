// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <deque>
#include <mutex>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/path_field.h"
#include "mjsense/core/text/json.h"

namespace mjsense {
namespace {

using Kind = FieldType::Kind;
constexpr double kMax = std::numeric_limits<double>::max();

bool same_word(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

// "a, b or c"
std::string listed(std::span<const std::string_view> words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += i == 0 ? "" : i + 1 == words.size() ? " or " : ", ";
    text += words[i];
  }
  return text;
}

// "sensor 'feet': reduce is 'max'"
std::string found(std::string_view context, std::string_view field, std::string_view value) {
  return fmt::format("{}{}{} is {}", context, context.empty() ? "" : ": ", field, value);
}

[[noreturn]] void throw_word(std::string_view text, std::span<const std::string_view> words,
                             std::string_view context, std::string_view field) {
  const std::vector<std::string> names(words.begin(), words.end());
  std::vector<std::string> shown = names;
  std::ranges::replace(shown, std::string(), std::string("\"\""));
  std::string hint;
  if (!nearest_names(text, names, 1).empty()) hint = suggest(text, names);
  throw ValueError(fmt::format("{}: must be one of {}{}",
                               found(context, field, fmt::format("'{}'", text)),
                               fmt::join(shown, ", "), hint));
}

std::string range_text(const FieldDecl& field) {
  const bool low = field.low > -kMax, high = field.high < kMax;
  if (low && high && field.above_low)
    return fmt::format("must be above {}, at most {}", field.low, field.high);
  if (low && high) return fmt::format("must be between {} and {}", field.low, field.high);
  if (high) return fmt::format("must be at most {}", field.high);
  if (low && field.above_low) return fmt::format("must be above {}", field.low);
  if (low) return fmt::format("must be at least {}", field.low);
  return std::isinf(field.high) ? "must be a number" : "must be finite";
}

bool in_range(const FieldDecl& field, double x) {
  return x >= field.low && x <= field.high && !(field.above_low && x == field.low);
}

void check_number(const FieldDecl& field, double x, const std::string& shown,
                  std::string_view context, std::string_view name) {
  if (in_range(field, x)) return;
  throw ValueError(fmt::format("{}: {}", found(context, name, shown), range_text(field)));
}

// Quick check of lists of numbers, which can be long: no element names are formatted.
bool right_numbers(const FieldDecl& field, const FieldType& type, const void* value) {
  if (type.kind == Kind::kNumber) return in_range(field, get_number(type, value));
  if (type.kind == Kind::kInt)
    return in_range(field, static_cast<double>(get_integer(type, value)));
  if (type.kind != Kind::kArray) return false;
  const FieldType& element = type.element();
  for (std::size_t i = 0; i < type.count(value); ++i) {
    if (!right_numbers(field, element, type.at(const_cast<void*>(value), i))) return false;
  }
  return true;
}

void check_list(const FieldDecl& field, const FieldType& type, const void* value,
                std::string_view context, const std::string& name);

void check_value(const FieldDecl& field, const FieldType& type, const void* value,
                 std::string_view context, const std::string& name) {
  switch (type.kind) {
    case Kind::kNumber: {
      const double x = get_number(type, value);
      return check_number(field, x, fmt::format("{}", x), context, name);
    }
    case Kind::kInt: {
      const std::int64_t x = get_integer(type, value);
      return check_number(field, static_cast<double>(x), fmt::format("{}", x), context, name);
    }
    case Kind::kText: {
      const auto& text = *static_cast<const std::string*>(value);
      // A text is used as it is written: unlike enumerations, words have one spelling.
      if (!field.words.empty() && std::ranges::find(field.words, text) == field.words.end())
        throw_word(text, field.words, context, name);
      return;
    }
    case Kind::kEnum:
    case Kind::kBool:
    case Kind::kUnsigned:
    case Kind::kPath:
      return;
    case Kind::kArray:
    case Kind::kList:
    case Kind::kOptional:
    case Kind::kMap:
      return check_list(field, type, value, context, name);
    case Kind::kObject: {
      const StructDecl& decl = type.object();
      const std::string inside = fmt::format("{}{}{}", context, context.empty() ? "" : ": ", name);
      return check_fields(decl, value, inside);
    }
    case Kind::kChoice: {
      const int which = type.which(value);
      if (!type.get(const_cast<void*>(value)))
        throw ValueError(fmt::format("{}{}{} is null", context, context.empty() ? "" : ": ", name));
      if (which < 0) return;  // unknown alternative, defined elsewhere: it checks itself
      const StructDecl& decl = *type.alternatives()[which];
      const std::string inside = fmt::format("{}{}{}", context, context.empty() ? "" : ": ", name);
      return check_fields(decl, type.get(const_cast<void*>(value)), inside);
    }
  }
}

void check_list(const FieldDecl& field, const FieldType& type, const void* value,
                std::string_view context, const std::string& name) {
  // the accessors of a type are shared by reading and writing
  void* list = const_cast<void*>(value);
  const std::size_t n = type.count(list);
  if (n == 0 && field.is_not_empty) {
    throw ValueError(fmt::format(
        "{}{}{} is empty{}", context, context.empty() ? "" : ": ", name,
        field.words.empty() ? "" : fmt::format("; choose from {}", fmt::join(field.words, ", "))));
  }
  const FieldType& element = type.element();
  for (std::size_t i = 0; i < n; ++i) {
    if (right_numbers(field, element, type.at(list, i))) continue;
    const bool whole =
        type.kind == Kind::kOptional || element.kind == Kind::kText || (field.is_or_one && n == 1);
    const std::string part = whole ? name
                             : type.kind == Kind::kMap
                                 ? fmt::format("{}['{}']", name, *type.key_at(list, i))
                                 : fmt::format("{}[{}]", name, i);
    check_value(field, element, type.at(list, i), context, part);
    if (field.words.empty() || element.kind != Kind::kText) continue;
    const auto& text = *static_cast<const std::string*>(type.at(list, i));
    for (std::size_t k = 0; k < i; ++k) {
      if (*static_cast<const std::string*>(type.at(list, k)) == text)
        throw ValueError(
            fmt::format("{}{}{} has '{}' twice", context, context.empty() ? "" : ": ", name, text));
    }
  }
}

std::string write_value(const FieldType& type, const void* value) {
  void* v = const_cast<void*>(value);
  switch (type.kind) {
    case Kind::kBool:
      return *static_cast<const bool*>(value) ? "true" : "false";
    case Kind::kInt:
      return fmt::format("{}", get_integer(type, value));
    case Kind::kUnsigned:
      return fmt::format("{}", *static_cast<const std::uint64_t*>(value));
    case Kind::kNumber:
      return type.bytes == sizeof(float) ? fmt::format("{}", *static_cast<const float*>(value))
                                         : fmt::format("{}", *static_cast<const double*>(value));
    case Kind::kText:
      return *static_cast<const std::string*>(value);
    case Kind::kPath:
      return static_cast<const std::filesystem::path*>(value)->string();
    case Kind::kEnum:
      return std::string(type.words[get_integer(type, value)]);
    case Kind::kOptional:
      return type.count(v) ? write_value(type.element(), type.at(v, 0)) : "";
    case Kind::kArray:
    case Kind::kList: {
      std::string text;
      for (std::size_t i = 0; i < type.count(v); ++i) {
        text += (i ? "," : "") + write_value(type.element(), type.at(v, i));
      }
      return text.empty() ? "none" : text;
    }
    case Kind::kMap:
    case Kind::kObject:
    case Kind::kChoice:
      break;
  }
  return "";
}

}  // namespace

int enum_index(std::string_view text, std::span<const std::string_view> words,
               std::string_view context, std::string_view field) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (same_word(text, words[i])) return static_cast<int>(i);
  }
  throw_word(text, words, context, field);
}

const FieldDecl* StructDecl::find(std::string_view field) const {
  const auto it = std::ranges::find_if(fields, [&](const FieldDecl& f) { return f.name == field; });
  return it == fields.end() ? nullptr : &*it;
}

std::shared_ptr<void> StructDecl::make() const { return {create(), destroy}; }

const StructDecl& field_detail::make_struct(const StructOf& of) {
  StructDecl decl;
  decl.create = of.create;
  decl.destroy = of.destroy;
  decl.validate = of.validate;
  const std::shared_ptr<void> instance = decl.make();
  FieldVisitor visitor(decl, instance.get());
  of.visit(visitor, instance.get());
  decl.defaults = instance;
  static std::mutex mutex;
  static std::deque<StructDecl> all;  // a deque, so that references stay valid
  const std::lock_guard lock(mutex);
  return all.emplace_back(std::move(decl));
}

FieldType CustomFieldType<std::filesystem::path>::make() {
  return {.kind = FieldType::Kind::kPath};
}

template const FieldType& field_type<bool>();
template const FieldType& field_type<int>();
template const FieldType& field_type<float>();
template const FieldType& field_type<double>();
template const FieldType& field_type<std::string>();
template const FieldType& field_type<std::vector<std::string>>();
template const FieldType& field_type<std::vector<double>>();
template const FieldType& field_type<std::array<float, 4>>();

FieldVisitor& FieldVisitor::object(const char* name, Sentence sentence, const char* kind) {
  if (included_ > 0) return *this;
  owner_ = name;
  if (depth_ > 0) {
    decl_.bases.push_back({name, sentence.text(), false});
  } else {
    decl_.name = name;
    decl_.sentence = sentence.text();
    decl_.kind = kind;
  }
  return *this;
}

FieldVisitor& FieldVisitor::frozen() {
  if (included_ == 0) (depth_ > 0 ? decl_.bases.back().frozen : decl_.frozen) = true;
  return *this;
}

FieldDecl& FieldVisitor::python(const char* name, const char* type, const char* default_value,
                                Sentence sentence) {
  FieldDecl& field = add(name, instance_, nullptr, sentence);
  field.python_type = type;
  field.python_default = default_value;
  return field;
}

FieldDecl& FieldVisitor::add(const char* name, const void* member, const FieldType* type,
                             Sentence sentence) {
  const auto offset = static_cast<std::size_t>(static_cast<const char*>(member) -
                                               static_cast<const char*>(instance_));
  return decl_.fields.emplace_back(FieldDecl{
      .name = name, .sentence = sentence.text(), .type = type, .offset = offset, .owner = owner_});
}

void check_fields(const StructDecl& decl, const void* object, std::string_view context) {
  for (const FieldDecl& field : decl.fields) check_field(field, object, context);
  if (decl.validate) decl.validate(object, context);
}

void check_field(const FieldDecl& field, const void* object, std::string_view context) {
  if (!field.type) return;
  check_value(field, *field.type, at(object, field), context, field.option_name());
}

void write_json(JsonWriter& json, const FieldDecl& field, const void* object) {
  const FieldType& type = *field.type;
  const void* value = at(object, field);
  if (type.kind == Kind::kBool) {
    json.value(*static_cast<const bool*>(value));
  } else if (type.kind == Kind::kUnsigned) {
    json.value(*static_cast<const std::uint64_t*>(value));
  } else if (type.kind == Kind::kInt) {
    json.value(get_integer(type, value));
  } else if (type.kind == Kind::kNumber) {
    json.value(get_number(type, value));
  } else {
    json.value(write_value(type, value));
  }
}

bool set_integer(const FieldType& type, void* value, std::int64_t x) {
  const auto set = [&]<class T>(T) {
    const auto narrow = static_cast<T>(x);
    if (static_cast<std::int64_t>(narrow) != x || (type.kind == Kind::kUnsigned && x < 0))
      return false;
    std::memcpy(value, &narrow, sizeof narrow);
    return true;
  };
  return type.bytes == 8   ? set(std::int64_t{})
         : type.bytes == 4 ? set(std::int32_t{})
                           : set(std::int8_t{});
}

std::int64_t get_integer(const FieldType& type, const void* value) {
  const auto get = [&]<class T>(T x) -> std::int64_t {
    std::memcpy(&x, value, sizeof x);
    return x;
  };
  return type.bytes == 8   ? get(std::int64_t{})
         : type.bytes == 4 ? get(std::int32_t{})
                           : get(std::int8_t{});
}

void set_number(const FieldType& type, void* value, double x) {
  if (type.bytes == sizeof(float)) {
    *static_cast<float*>(value) = static_cast<float>(x);
  } else {
    *static_cast<double*>(value) = x;
  }
}

double get_number(const FieldType& type, const void* value) {
  return type.bytes == sizeof(float) ? *static_cast<const float*>(value)
                                     : *static_cast<const double*>(value);
}

std::string expected(const FieldType& type) {
  switch (type.kind) {
    case Kind::kBool:
      return "a bool";
    case Kind::kInt:
      return "an int";
    case Kind::kUnsigned:
      return "an int from 0 on";
    case Kind::kNumber:
      return "a number";
    case Kind::kText:
    case Kind::kPath:
      return "a str";
    case Kind::kEnum:
      return listed(type.words);
    case Kind::kArray:
      return fmt::format("{} numbers", type.count(nullptr));
    case Kind::kList:
      return "a list, each " + expected(type.element());
    case Kind::kOptional:
      return expected(type.element()) + " or None";
    case Kind::kMap:
      return "a mapping";
    case Kind::kObject:
      return fmt::format("{}", type.object().name);
    case Kind::kChoice: {
      std::string names;
      for (const StructDecl* decl : type.alternatives())
        names += (names.empty() ? "" : ", ") + std::string(decl->name);
      return "one of " + names;
    }
  }
  return "";
}

}  // namespace mjsense
