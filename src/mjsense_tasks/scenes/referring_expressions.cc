// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/referring_expressions.h"

namespace mjsense::tasks::scenes {

std::vector<episode::Referral> referring_expressions(const SceneObject& object) {
  std::vector<episode::Referral> texts{{object.text, object.others.empty() ? 1.0 : 0.5}};
  double left = 0.5;
  for (std::size_t i = 0; i < object.others.size(); ++i) {
    const double share = i + 1 == object.others.size() ? left : 0.6 * left;
    texts.push_back({object.others[i], share});
    left -= share;
  }
  return texts;
}

}  // namespace mjsense::tasks::scenes
