// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/model_checksums.h"

#include <mujoco/mjxmacro.h>

#include <string_view>

#include "mjsense/record/checksum.h"

namespace mjsense::record {

std::map<std::string, std::string> model_checksums(const mjModel& model) {
  std::map<std::string, Checksum> sums;
  const mjModel* m = &model;
  {
    // Fields are added one by one, because the padding bytes between them are undefined.
    Checksum& option = sums["option"];
#define X(type, name, n) option.add(&m->opt.name, sizeof(type) * (n));
#define XVEC(type, name, n) option.add(m->opt.name, sizeof(type) * (n));
    MJOPTION_FIELDS
#undef XVEC
#undef X
  }
  // All members have the same type, so there is no padding.
  sums["statistic"].add(&m->stat, sizeof m->stat);
  sums["visual"].add(&m->vis, sizeof m->vis);

  const auto add = [&](std::string_view name, const void* data, std::size_t bytes) {
    // "qpos0" and "qpos_spring" both count as "qpos".
    std::string_view kind = name.substr(0, name.find('_'));
    if (kind == "qpos0") kind = "qpos";
    if (kind == "bvh") return;  // derived from the geoms and meshes
    if (kind == "paths" || name.ends_with("_pathadr")) return;
    // The boundary between two arrays is part of the data.
    sums[std::string(kind)].add(&bytes, sizeof bytes);
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

}  // namespace mjsense::record
