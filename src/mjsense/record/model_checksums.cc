// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/model_checksums.h"

#include <mujoco/mjxmacro.h>

#include <string_view>

#include "mjsense/record/checksum.h"

namespace mjsense {

std::map<std::string, std::string> model_checksums(const mjModel& model) {
  std::map<std::string, Checksum> sums;
  const mjModel* m = &model;
  {
    // The fields one by one: the bytes between them may hold anything.
    Checksum& option = sums["option"];
#define X(type, name, n) option.add(&m->opt.name, sizeof(type) * (n));
#define XVEC(type, name, n) option.add(m->opt.name, sizeof(type) * (n));
    MJOPTION_FIELDS
#undef XVEC
#undef X
  }
  sums["statistic"].add(&m->stat, sizeof m->stat);  // of one type each, so without gaps
  sums["visual"].add(&m->vis, sizeof m->vis);

  const auto add = [&](std::string_view name, const void* data, std::size_t bytes) {
    // "qpos0" and "qpos_spring" are both of "qpos".
    std::string_view kind = name.substr(0, name.find('_'));
    if (kind == "qpos0") kind = "qpos";
    if (kind == "bvh") return;  // follows from the geoms and meshes
    if (kind == "paths" || name.ends_with("_pathadr")) return;
    sums[std::string(kind)].add(&bytes, sizeof bytes);  // where one array ends is data, too
    sums[std::string(kind)].add(data, bytes);
  };
  MJMODEL_POINTERS_PREAMBLE(m)
#define X(type, name, rows, columns) \
  add(#name, m->name,                \
      sizeof(type) * static_cast<std::size_t>(m->rows) * static_cast<std::size_t>(columns));
  MJMODEL_POINTERS
#undef X

  std::map<std::string, std::string> texts;
  for (const auto& [kind, sum] : sums) texts[kind] = sum.text();
  return texts;
}

}  // namespace mjsense
