// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/state_components.h"

#include <cmath>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

struct Component {
  std::string_view name;
  int bit;
  int width;  // columns per element; 0: scalar elements, one column each
};
constexpr Component kComponents[] = {{"time", mjSTATE_TIME, 0},
                                     {"qpos", mjSTATE_QPOS, 0},
                                     {"qvel", mjSTATE_QVEL, 0},
                                     {"act", mjSTATE_ACT, 0},
                                     {"ctrl", mjSTATE_CTRL, 0},
                                     {"qfrc_applied", mjSTATE_QFRC_APPLIED, 0},
                                     {"xfrc_applied", mjSTATE_XFRC_APPLIED, 6},
                                     {"eq_active", mjSTATE_EQ_ACTIVE, 0},
                                     {"mocap_pos", mjSTATE_MOCAP_POS, 3},
                                     {"mocap_quat", mjSTATE_MOCAP_QUAT, 4},
                                     {"qacc_warmstart", mjSTATE_WARMSTART, 0},
                                     {"userdata", mjSTATE_USERDATA, 0}};

}  // namespace

std::string_view bad_component(mjBatch* batch, int w) {
  const auto size = static_cast<std::size_t>(mjb_nstate(batch));
  const mjtNum* row = mjb_state(batch) + w * size;
  // The sum of zero multiples is 0 unless a term is NaN or infinite. Only then the components are
  // searched.
  mjtNum sum = 0;
  for (std::size_t i = 0; i < size; ++i) sum += row[i] * 0;
  if (sum == 0) return "";
  for (const Component& c : kComponents) {
    int count = 0;
    const mjtNum* part = mjb_stateComponent(batch, c.bit, &count) + w * size;
    for (int i = 0; i < count; ++i) {
      if (!std::isfinite(part[i])) return c.name;
    }
  }
  return "";
}

ArrayView Worlds::state() {
  return ArrayView::dense(mjb_state(batch_), DType::kFloat64,
                          {num_worlds_, static_cast<std::int64_t>(num_state_)});
}

ArrayView Worlds::state_component(std::string_view name) {
  const Component& c =
      find_named(kComponents, &Component::name, name, "simulation", "state component");
  int size = 0;
  mjtNum* data = mjb_stateComponent(batch_, c.bit, &size);
  ArrayView v =
      c.width > 0 ? ArrayView::dense(data, DType::kFloat64, {num_worlds_, size / c.width, c.width})
                  : ArrayView::dense(data, DType::kFloat64, {num_worlds_, size});
  v.strides[0] = static_cast<std::int64_t>(num_state_ * sizeof(mjtNum));
  return v;
}

}  // namespace mjsense::worlds
