// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/system/cpu.h"
#include "mjsense/render/view/view.h"

namespace mjsense::render {

RenderTiles best_render_tiles() {
  switch (cpu_isa()) {
#if defined(__x86_64__)
    case Isa::kAvx512:
      return render_tiles_avx512;
    case Isa::kAvx2:
      return render_tiles_avx2;
#endif
    default:
      return render_tiles_portable;
  }
}

MayShow best_may_show() {
  switch (cpu_isa()) {
#if defined(__x86_64__)
    case Isa::kAvx512:
      return may_show_avx512;
    case Isa::kAvx2:
      return may_show_avx2;
#endif
    default:
      return may_show_portable;
  }
}

}  // namespace mjsense::render
