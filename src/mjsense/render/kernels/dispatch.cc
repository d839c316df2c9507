// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/cpu.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {
namespace {

struct Kernels {
  RenderTiles render_tiles;
  MayShow may_show;
};

Kernels best_kernels() {
  if constexpr (kHasAvx) {
    if (cpu_isa() == Isa::kAvx512) return {render_tiles_avx512, may_show_avx512};
    if (cpu_isa() == Isa::kAvx2) return {render_tiles_avx2, may_show_avx2};
  }
  return {render_tiles_portable, may_show_portable};
}

}  // namespace

RenderTiles best_render_tiles() { return best_kernels().render_tiles; }
MayShow best_may_show() { return best_kernels().may_show; }

}  // namespace mjsense::render
