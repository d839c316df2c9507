// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/yuv_impl.h"

namespace mjsense::record {

void yuv420_avx512(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                   std::int16_t* scratch) {
  convert(rgb, width, height, out, scratch);
}

}  // namespace mjsense::record
