// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/kernels_impl.h"

namespace mjsense::rays {

const RayKernels& portable_kernels() { return kKernels; }

}  // namespace mjsense::rays
