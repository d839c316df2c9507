// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/array.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <new>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

struct DTypeInfo {
  std::string_view name;
  std::size_t size;
};
constexpr DTypeInfo kDTypes[] = {{"float32", 4}, {"float64", 8}, {"uint8", 1}, {"uint16", 2},
                                 {"int32", 4},   {"int64", 8},   {"bool", 1}};
constexpr std::align_val_t kAlign{64};

}  // namespace

std::size_t dtype_size(DType dtype) { return kDTypes[static_cast<int>(dtype)].size; }
std::string_view dtype_name(DType dtype) { return kDTypes[static_cast<int>(dtype)].name; }

DType dtype_from_name(std::string_view name) {
  for (int i = 0; i < static_cast<int>(std::size(kDTypes)); ++i) {
    if (kDTypes[i].name == name) return static_cast<DType>(i);
  }
  throw ValueError(fmt::format("unknown dtype '{}'", name));
}

Shape::Shape(std::initializer_list<std::int64_t> dims)
    : Shape(std::span(dims.begin(), dims.size())) {}

Shape::Shape(std::span<const std::int64_t> dims) {
  if (dims.size() > kMaxRank)
    throw ValueError(fmt::format("array of rank {}: the maximum is {}", dims.size(), kMaxRank));
  for (std::int64_t d : dims) {
    if (d < 0) throw ValueError(fmt::format("negative dimension {}", d));
    dims_[rank_++] = d;
  }
}

std::int64_t Shape::size() const {
  std::int64_t n = 1;
  for (std::int64_t d : dims()) n *= d;
  return n;
}

Shape Shape::with_front(std::int64_t dim) const {
  std::array<std::int64_t, kMaxRank + 1> d{dim};
  std::copy_n(dims_.begin(), rank_, d.begin() + 1);
  return Shape(std::span<const std::int64_t>(d.data(), rank_ + 1));
}

Shape Shape::without_front() const { return Shape(dims().subspan(1)); }

bool Shape::operator==(const Shape& other) const {
  return std::ranges::equal(dims(), other.dims());
}

std::string Shape::str() const {
  return rank_ == 1 ? fmt::format("({},)", dims_[0]) : fmt::format("({})", fmt::join(dims(), ", "));
}

ArrayView ArrayView::dense(void* data, DType dtype, const Shape& shape) {
  ArrayView v{static_cast<std::byte*>(data), dtype, shape, {}};
  auto stride = static_cast<std::int64_t>(dtype_size(dtype));
  for (int i = shape.rank() - 1; i >= 0; --i) {
    v.strides[i] = stride;
    stride *= shape[i];
  }
  return v;
}

Array::Array(DType dtype, const Shape& shape) : dtype_(dtype), shape_(shape) {
  if (shape.rank() == 0) throw ValueError("an array needs a leading dimension");
  row_elements_ = static_cast<std::size_t>(shape.without_front().size());
  data_.reset(static_cast<std::byte*>(::operator new[](std::max<std::size_t>(bytes(), 1), kAlign)));
  fill_zero();
}

Array Array::shared(Array& owner, DType dtype, const Shape& shape) {
  Array out;
  out.dtype_ = dtype;
  out.shape_ = shape;
  out.row_elements_ = static_cast<std::size_t>(shape.without_front().size());
  if (out.bytes() != owner.bytes() || out.row_bytes() != owner.row_bytes()) {
    throw ValueError(fmt::format("{} {} cannot share the memory of {} {}", dtype_name(dtype),
                                 shape.str(), dtype_name(owner.dtype()), owner.shape().str()));
  }
  out.data_ = std::unique_ptr<std::byte[], Free>(owner.data(), Free(false));
  return out;
}

void Array::fill_zero() { std::memset(data_.get(), 0, bytes()); }

void Array::throw_type_mismatch(DType asked) const {
  throw RuntimeError(fmt::format("an array {} of {} cannot be read as {}", shape_.str(),
                                 dtype_name(dtype_), dtype_name(asked)));
}

void Array::Free::operator()(std::byte* p) const {
  if (owned) ::operator delete[](p, kAlign);
}

}  // namespace mjsense
