#include "mjsense/rays/kernels_impl.h"

namespace mjsense {

const RayKernels& avx512_kernels() { return kKernels; }

}  // namespace mjsense
