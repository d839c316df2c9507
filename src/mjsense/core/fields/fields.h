// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reflection of configuration structs. Each struct declares its fields once, next to its
// definition:
//
//   template <class V>
//   void visit_fields(V& v, ContactSensorCfg& c) {
//     v.object("ContactSensorCfg", "Contacts of primaries.", "contact");
//     v("num_slots", c.num_slots, "Contacts kept for each primary.").at_least(1);
//     v("max_distance", c.max_distance, "Hits farther away are misses.").unit("m").positive();
//   }
//
// The checks below, the Python bindings, the program's options, experiment files, the fingerprint
// of a recording and the documentation all use this declaration. The sentence is mandatory: without
// it the code does not compile. Consumers are written once, for the table that struct_of<T>()
// builds from visit_fields(), instead of once per struct.
//
// Headers that only declare fields do not include this file, but the small ones that they need:
// core/fields/named_enum.h, core/fields/field_traits.h, core/fields/path_field.h.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "mjsense/core/fields/field_traits.h"
#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/text/sentence.h"

namespace mjsense {

class JsonWriter;
struct StructDecl;

// Type of a value, with type-erased access to it.
struct FieldType {
  enum class Kind {
    kBool,
    kInt,
    kUnsigned,
    kNumber,
    kText,
    kPath,
    kEnum,      // an enumeration
    kArray,     // of fixed length
    kList,      // std::vector
    kOptional,  // accessed as a list of 0 or 1 elements
    kMap,       // std::vector of (name, value), in insertion order
    kObject,    // a struct with visit_fields()
    kChoice,    // std::variant of structs, distinguished by StructDecl::kind
  };
  Kind kind;
  std::size_t bytes = 0;                      // of numbers
  std::span<const std::string_view> words{};  // kEnum
  // kArray, kList, kOptional, kMap
  const FieldType& (*element)() = nullptr;
  std::size_t (*count)(const void* list) = nullptr;
  void* (*at)(void* list, std::size_t i) = nullptr;
  std::string* (*key_at)(void* list, std::size_t i) = nullptr;  // kMap
  void (*clear)(void* list) = nullptr;
  void* (*append)(void* list) = nullptr;
  // kObject
  const StructDecl& (*object)() = nullptr;
  // kChoice: name in Python, the alternatives, index of the current one, pointer to it, and a
  // function that replaces it
  const char* choice = nullptr;
  std::span<const StructDecl* const> (*alternatives)() = nullptr;
  int (*which)(const void* value) = nullptr;
  void* (*get)(void* value) = nullptr;
  void* (*emplace)(void* value, int alternative) = nullptr;
  // index of the alternative that a plain number constructs, as its first field; -1: none
  int plain = -1;
};

// One field. The member functions below add further properties and can be chained.
struct FieldDecl {
  const char* name;
  const char* sentence;
  const FieldType* type;  // null: the field exists in Python only
  std::size_t offset;
  // name of the struct that declares the field; a base class for inherited fields
  const char* owner;

  const char* unit_ = "";
  double low = -std::numeric_limits<double>::max(), high = std::numeric_limits<double>::max();
  bool above_low = false;  // `low` itself is excluded
  bool is_required = false, is_or_none = false, is_or_one = false, is_not_empty = false;
  std::span<const std::string_view> words{};  // accepted words of a text or of a list of texts
  const char* option_ = nullptr;  // name as an option of recordings, if it differs from `name`
  const char* flag_ = nullptr;    // name on the command line, if it differs from the option
  const char* fingerprint = nullptr;
  bool is_hidden = false, is_resolved = false;
  const char* python_type = "";
  const char* python_default = "";

  FieldDecl& unit(const char* u) { return unit_ = u, *this; }
  // Valid range of the field or of each of its components. NaN is never valid, infinity only if
  // allowed explicitly.
  FieldDecl& at_least(double x) { return low = x, *this; }
  FieldDecl& at_most(double x) { return high = x, *this; }
  FieldDecl& within(double a, double b) { return low = a, high = b, *this; }
  FieldDecl& above(double x) { return low = x, above_low = true, *this; }
  FieldDecl& positive() { return above(0); }
  FieldDecl& may_be_infinite() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    if (low == -std::numeric_limits<double>::max()) low = -kInfinity;
    if (high == std::numeric_limits<double>::max()) high = kInfinity;
    return *this;
  }
  FieldDecl& one_of(std::span<const std::string_view> w) { return words = w, *this; }
  FieldDecl& not_empty() { return is_not_empty = true, *this; }
  // Signature in Python: no default; None for an empty value; a single value instead of a list.
  FieldDecl& required() { return is_required = true, *this; }
  FieldDecl& or_none() { return is_or_none = true, *this; }
  FieldDecl& or_one() { return is_or_one = true, *this; }
  // Recordings: a different option name; no option at all; whether a recording can be resumed only
  // if the value is equal, and the key under which the recording's settings store it.
  FieldDecl& option(const char* o) { return option_ = o, *this; }
  FieldDecl& flag(const char* f) { return flag_ = f, *this; }
  FieldDecl& hidden() { return is_hidden = true, *this; }
  FieldDecl& decides_data() { return fingerprint = name, *this; }
  FieldDecl& decides_data_as(const char* key) {  // `key` stores the resolved value
    return fingerprint = key, is_resolved = true, *this;
  }
  const char* option_name() const { return option_ ? option_ : name; }
  const char* flag_name() const { return flag_ ? flag_ : option_name(); }
};

struct StructDecl {
  struct Base {
    const char *name, *sentence;
    bool frozen;
  };
  const char* name = "";  // name in Python
  const char* sentence = "";
  const char* kind = "";    // "contact", "grid" ...: distinguishes the alternatives of a choice
  const char* module = "";  // Python module, if not configs
  bool frozen = false;
  std::vector<Base> bases;  // the direct base first
  std::vector<FieldDecl> fields;
  std::shared_ptr<const void> defaults;
  // Checks relations between fields: validate(cfg, place) next to the struct, or its member
  // function.
  void (*validate)(const void* object, std::string_view context) = nullptr;
  void* (*create)() = nullptr;
  void (*destroy)(void* object) = nullptr;

  const FieldDecl* find(std::string_view field) const;
  std::shared_ptr<void> make() const;  // a new object with the defaults
};

inline void* at(void* object, const FieldDecl& field) {
  return static_cast<char*>(object) + field.offset;
}
inline const void* at(const void* object, const FieldDecl& field) {
  return static_cast<const char*>(object) + field.offset;
}

template <class T>
const FieldType& field_type();

// The visitor passed to visit_fields(); it fills a StructDecl.
class FieldVisitor {
 public:
  FieldVisitor(StructDecl& decl, const void* instance) : decl_(decl), instance_(instance) {}

  // Must be the first call: describes the struct itself.
  FieldVisitor& object(const char* name, Sentence sentence, const char* kind = "");
  FieldVisitor& frozen();  // the Python dataclass is frozen
  FieldVisitor& module(const char* name) {
    return depth_ == 0 ? decl_.module = name, *this : *this;
  }

  template <class T>
  FieldDecl& operator()(const char* name, T& member, Sentence sentence) {
    return add(name, &member, &field_type<T>(), sentence);
  }
  // A field that exists in Python only.
  FieldDecl& python(const char* name, const char* type, const char* default_value,
                    Sentence sentence);
  // Fields of a base class, which is also a base class in Python.
  template <class B>
  void extends(B& base) {
    const char* owner = owner_;
    ++depth_;
    visit_fields(*this, base);
    --depth_;
    owner_ = owner;
  }
  // Fields of a member, declared as fields of this struct.
  template <class B>
  void include(B& part) {
    ++included_;
    extends(part);
    --included_;
  }

 private:
  FieldDecl& add(const char* name, const void* member, const FieldType* type, Sentence sentence);
  StructDecl& decl_;
  const void* instance_;
  const char* owner_ = "";
  int depth_ = 0, included_ = 0;
};

template <class T>
concept Described = requires(FieldVisitor& v, T& t) {
  visit_fields(v, t);
};

namespace field_detail {

// Type-erased functions of a struct, so that the code that uses them is compiled once.
struct StructOf {
  void* (*create)();
  void (*destroy)(void* object);
  void (*visit)(FieldVisitor& visitor, void* object);
  void (*validate)(const void* object, std::string_view context);
};
const StructDecl& make_struct(const StructOf& of);

template <class T>
constexpr auto validator() -> void (*)(const void* object, std::string_view context) {
  if constexpr (requires(const T& t) { t.validate(std::string_view()); }) {
    return [](const void* object, std::string_view context) {
      static_cast<const T*>(object)->validate(context);
    };
  } else if constexpr (requires(const T& t) { validate(t, std::string_view()); }) {
    return [](const void* object, std::string_view context) {
      validate(*static_cast<const T*>(object), context);
    };
  } else {
    return nullptr;
  }
}

}  // namespace field_detail

template <Described T>
const StructDecl& struct_of() {
  static const StructDecl& kDecl = field_detail::make_struct(
      {[]() -> void* { return new T(); }, [](void* object) { delete static_cast<T*>(object); },
       [](FieldVisitor& v, void* object) { visit_fields(v, *static_cast<T*>(object)); },
       field_detail::validator<T>()});
  return kDecl;
}

// Throws ValueError for the first field that is out of range, NaN, or not a known word: "sensor
// 'feet': num_slots is 0: must be at least 1".
void check_fields(const StructDecl& decl, const void* object, std::string_view context);

// Checks one field only.
void check_field(const FieldDecl& field, const void* object, std::string_view context);

template <Described T>
void check_fields(const T& object, std::string_view context) {
  check_fields(struct_of<T>(), &object, context);
}

// Writes a bool, a number or a text.
void write_json(JsonWriter& json, const FieldDecl& field, const void* object);
// Access to numbers of any width. set_integer() returns false if the value does not fit.
bool set_integer(const FieldType& type, void* value, std::int64_t x);
std::int64_t get_integer(const FieldType& type, const void* value);
void set_number(const FieldType& type, void* value, double x);
double get_number(const FieldType& type, const void* value);
// "an int", "a number", "3 numbers" ...
std::string expected(const FieldType& type);

// ------------------------------------------------------------------------------ types of values

namespace field_detail {

using Kind = FieldType::Kind;

template <class T>
inline constexpr bool kIsNamedEnum = false;
template <class E>
inline constexpr bool kIsNamedEnum<NamedEnum<E>> = true;
template <class T>
inline constexpr bool kIsArray = false;
template <class T, std::size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;
template <class T>
inline constexpr bool kIsList = false;
template <class T>
inline constexpr bool kIsList<std::vector<T>> = true;
template <class T>
inline constexpr bool kIsMap = false;
template <class T>
inline constexpr bool kIsMap<std::vector<std::pair<std::string, T>>> = true;
template <class T>
inline constexpr bool kIsOptional = false;
template <class T>
inline constexpr bool kIsOptional<std::optional<T>> = true;
template <class T>
inline constexpr bool kIsVariant = false;
template <class... T>
inline constexpr bool kIsVariant<std::variant<T...>> = true;

// Containers share one set of accessor functions.
template <class L>
constexpr FieldType array() {
  return {.kind = Kind::kArray,
          .element = &field_type<typename L::value_type>,
          .count = [](const void*) { return std::tuple_size_v<L>; },
          .at = [](void* list, std::size_t i) -> void* { return &(*static_cast<L*>(list))[i]; }};
}
template <class L>
constexpr FieldType list() {
  return {.kind = Kind::kList,
          .element = &field_type<typename L::value_type>,
          .count = [](const void* list) { return static_cast<const L*>(list)->size(); },
          .at = [](void* list, std::size_t i) -> void* { return &(*static_cast<L*>(list))[i]; },
          .clear = [](void* list) { static_cast<L*>(list)->clear(); },
          .append = [](void* list) -> void* { return &static_cast<L*>(list)->emplace_back(); }};
}
template <class L>
constexpr FieldType map() {
  return {
      .kind = Kind::kMap,
      .element = &field_type<typename L::value_type::second_type>,
      .count = [](const void* list) { return static_cast<const L*>(list)->size(); },
      .at = [](void* list, std::size_t i) -> void* { return &(*static_cast<L*>(list))[i].second; },
      .key_at = [](void* list, std::size_t i) { return &(*static_cast<L*>(list))[i].first; },
      .clear = [](void* list) { static_cast<L*>(list)->clear(); },
      .append = [](void* list) -> void* { return &static_cast<L*>(list)->emplace_back().second; }};
}
template <class L>
constexpr FieldType optional() {
  return {
      .kind = Kind::kOptional,
      .element = &field_type<typename L::value_type>,
      .count = [](const void* o) -> std::size_t { return static_cast<const L*>(o)->has_value(); },
      .at = [](void* o, std::size_t) -> void* { return &**static_cast<L*>(o); },
      .clear = [](void* o) { static_cast<L*>(o)->reset(); },
      .append = [](void* o) -> void* { return &static_cast<L*>(o)->emplace(); }};
}

template <class V>
struct Variant;
template <class... T>
struct Variant<std::variant<T...>> {
  using V = std::variant<T...>;
  static std::span<const StructDecl* const> alternatives() {
    static const std::array<const StructDecl*, sizeof...(T)> kAll{&struct_of<T>()...};
    return kAll;
  }
  static int which(const void* value) {
    return static_cast<int>(static_cast<const V*>(value)->index());
  }
  static void* get(void* value) {
    return std::visit([](auto& x) -> void* { return &x; }, *static_cast<V*>(value));
  }
  static void* emplace(void* value, int alternative) {
    using Make = void (*)(V&);
    static constexpr Make kMake[] = {[](V& v) { v = T{}; }...};
    kMake[alternative](*static_cast<V*>(value));
    return get(value);
  }
};

template <class T>
constexpr FieldType make() {
  if constexpr (std::is_same_v<T, bool>) {
    return {.kind = Kind::kBool, .bytes = sizeof(T)};
  } else if constexpr (std::is_integral_v<T>) {
    return {.kind = std::is_signed_v<T> ? Kind::kInt : Kind::kUnsigned, .bytes = sizeof(T)};
  } else if constexpr (std::is_floating_point_v<T>) {
    return {.kind = Kind::kNumber, .bytes = sizeof(T)};
  } else if constexpr (std::is_same_v<T, std::string>) {
    return {.kind = Kind::kText};
  } else if constexpr (kIsNamedEnum<T>) {
    return {.kind = Kind::kEnum, .bytes = sizeof(T), .words = kEnumNames<typename T::Enum>};
  } else if constexpr (HasEnumNames<T>) {
    return {.kind = Kind::kEnum, .bytes = sizeof(T), .words = kEnumNames<T>};
  } else if constexpr (kIsArray<T>) {
    return array<T>();
  } else if constexpr (kIsMap<T>) {
    return map<T>();
  } else if constexpr (kIsList<T>) {
    return list<T>();
  } else if constexpr (kIsOptional<T>) {
    return optional<T>();
  } else if constexpr (kIsVariant<T>) {
    using Of = Variant<T>;
    return {.kind = Kind::kChoice,
            .choice = kChoiceName<T>,
            .alternatives = &Of::alternatives,
            .which = &Of::which,
            .get = &Of::get,
            .emplace = &Of::emplace,
            .plain = kPlainAlternative<T>};
  } else {
    static_assert(Described<T>,
                  "not a field type: declare visit_fields() next to it; for a path, include "
                  "core/fields/path_field.h");
    return {.kind = Kind::kObject, .object = &struct_of<T>};
  }
}

}  // namespace field_detail

template <class T>
const FieldType& field_type() {
  if constexpr (requires { CustomFieldType<T>::make(); }) {
    static const FieldType kType = CustomFieldType<T>::make();
    return kType;
  } else {
    static constexpr FieldType kType = field_detail::make<T>();
    return kType;
  }
}

// Common types are instantiated once, in fields.cc.
extern template const FieldType& field_type<bool>();
extern template const FieldType& field_type<int>();
extern template const FieldType& field_type<float>();
extern template const FieldType& field_type<double>();
extern template const FieldType& field_type<std::string>();
extern template const FieldType& field_type<std::vector<std::string>>();
extern template const FieldType& field_type<std::vector<double>>();
extern template const FieldType& field_type<std::array<float, 4>>();

}  // namespace mjsense
