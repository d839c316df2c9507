// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/all_effects.h"

#include <vector>

#include "mjsense/core/fields/fields.h"

namespace mjsense::effects {
namespace {

using Shared = std::shared_ptr<const Effect>;

struct Alternative {
  const StructDecl* decl;
  std::unique_ptr<Effect> (*make)();
};

template <class... E>
std::vector<Alternative> alternatives(EffectTypes<E...>) {
  return {{&struct_of<E>(), []() -> std::unique_ptr<Effect> { return std::make_unique<E>(); }}...};
}

const std::vector<Alternative>& all() {
  static const std::vector<Alternative> kAll = alternatives(AllEffects{});
  return kAll;
}

// Address of the complete object. Field offsets are relative to it, and not to its base class
// Effect.
void* whole(const Shared& effect) {
  return const_cast<void*>(dynamic_cast<const void*>(effect.get()));
}

FieldType effect_type() {
  FieldType t{.kind = FieldType::Kind::kChoice, .choice = "Effect"};
  t.alternatives = []() -> std::span<const StructDecl* const> {
    static const std::vector<const StructDecl*> kDecls = [] {
      std::vector<const StructDecl*> decls;
      for (const Alternative& a : all()) decls.push_back(a.decl);
      return decls;
    }();
    return kDecls;
  };
  t.which = [](const void* value) {
    const auto& effect = *static_cast<const Shared*>(value);
    for (std::size_t i = 0; effect && i < all().size(); ++i) {
      if (effect->kind() == all()[i].decl->kind) return static_cast<int>(i);
    }
    return -1;
  };
  t.get = [](void* value) { return whole(*static_cast<Shared*>(value)); };
  t.emplace = [](void* value, int alternative) {
    auto& effect = *static_cast<Shared*>(value);
    effect = all()[alternative].make();
    return whole(effect);
  };
  return t;
}

}  // namespace

void check_effect(const Shared& effect, std::string_view context) {
  const FieldType& type = field_type<Shared>();
  const int which = type.which(&effect);
  if (which < 0) return effect->validate(context);
  check_fields(*type.alternatives()[which], whole(effect), context);
}

}  // namespace mjsense::effects

mjsense::FieldType
mjsense::CustomFieldType<std::shared_ptr<const mjsense::effects::Effect>>::make() {
  return mjsense::effects::effect_type();
}
