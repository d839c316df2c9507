#include "mjsense/rays/kernels_impl.h"

namespace mjsense {

const RayKernels& portable_kernels() { return kKernels; }

}  // namespace mjsense
