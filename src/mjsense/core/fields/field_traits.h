// SPDX-License-Identifier: Apache-2.0
#pragma once
// Templates that are specialised next to a type that is used for fields (core/fields/fields.h).

namespace mjsense {

struct FieldType;

// Name of a choice in Python. Specialise next to the variant: template <> ...
// kChoiceName<PatternCfg>.
template <class V>
inline constexpr const char* kChoiceName = "";
template <class V>
inline constexpr int kPlainAlternative = -1;

// Specialise for other types of values; see effects/all_effects.h, core/fields/path_field.h.
template <class T>
struct CustomFieldType;

}  // namespace mjsense
