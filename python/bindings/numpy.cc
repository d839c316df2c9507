// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/numpy.h"

#include "mjsense/core/error.h"

namespace mjsense::python {
namespace {

nb::dlpack::dtype dlpack_type(DType dtype) {
  switch (dtype) {
    case DType::kFloat32:
      return nb::dtype<float>();
    case DType::kFloat64:
      return nb::dtype<double>();
    case DType::kUint8:
      return nb::dtype<std::uint8_t>();
    case DType::kUint16:
      return nb::dtype<std::uint16_t>();
    case DType::kInt32:
      return nb::dtype<std::int32_t>();
    case DType::kInt64:
      return nb::dtype<std::int64_t>();
    case DType::kBool:
      return nb::dtype<bool>();
  }
  throw ValueError("unknown dtype");
}

template <class... Access>
NumpyArray make_numpy(const ArrayView& view, nb::handle owner) {
  const int rank = view.shape.rank();
  const auto item = static_cast<std::int64_t>(dtype_size(view.dtype));
  std::array<std::size_t, Shape::kMaxRank> shape{};
  std::array<std::int64_t, Shape::kMaxRank> strides{};  // in elements, as in DLPack
  for (int i = 0; i < rank; ++i) {
    shape[i] = static_cast<std::size_t>(view.shape[i]);
    if (view.strides[i] % item != 0)
      throw RuntimeError("array strides are not a multiple of its element size");
    strides[i] = view.strides[i] / item;
  }
  // An empty array may have no memory, but an owner requires a non-null pointer.
  static std::byte nothing[64];
  void* data = view.data ? view.data : nothing;
  nb::object array =
      nb::cast(nb::ndarray<nb::numpy, Access...>(data, static_cast<std::size_t>(rank), shape.data(),
                                                 owner, strides.data(), dlpack_type(view.dtype)));
  return nb::steal<NumpyArray>(array.release());
}

}  // namespace

NumpyArray to_numpy(const ArrayView& view, nb::handle owner) { return make_numpy<>(view, owner); }
NumpyArray to_readonly_numpy(const ArrayView& view, nb::handle owner) {
  return make_numpy<nb::ro>(view, owner);
}

}  // namespace mjsense::python
