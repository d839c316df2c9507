// SPDX-License-Identifier: Apache-2.0
#pragma once
// Typed n-dimensional arrays. Sensors own them, suites return them as observations, recordings
// store them, and Python accesses them without a copy.

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace mjsense {

enum class DType : std::uint8_t { kFloat32, kFloat64, kUint8, kUint16, kInt32, kInt64, kBool };

std::size_t dtype_size(DType dtype);
std::string_view dtype_name(DType dtype);      // NumPy's name: "float32", "uint8", "bool" ...
DType dtype_from_name(std::string_view name);  // throws ValueError

template <class T>
constexpr DType dtype_of();
template <>
constexpr DType dtype_of<float>() {
  return DType::kFloat32;
}
template <>
constexpr DType dtype_of<double>() {
  return DType::kFloat64;
}
template <>
constexpr DType dtype_of<std::uint8_t>() {
  return DType::kUint8;
}
template <>
constexpr DType dtype_of<std::uint16_t>() {
  return DType::kUint16;
}
template <>
constexpr DType dtype_of<std::int32_t>() {
  return DType::kInt32;
}
template <>
constexpr DType dtype_of<std::int64_t>() {
  return DType::kInt64;
}
template <>
constexpr DType dtype_of<bool>() {
  return DType::kBool;
}

// Up to 6 dimensions, stored without heap allocation.
class Shape {
 public:
  static constexpr int kMaxRank = 6;
  Shape() = default;
  Shape(std::initializer_list<std::int64_t> dims);
  explicit Shape(std::span<const std::int64_t> dims);

  int rank() const { return rank_; }
  std::int64_t operator[](int i) const { return dims_[i]; }
  std::int64_t size() const;  // number of elements; 1 for a scalar
  std::span<const std::int64_t> dims() const {
    return {dims_.data(), static_cast<std::size_t>(rank_)};
  }
  [[nodiscard]] Shape with_front(std::int64_t dim) const;  // (dim, *this)
  [[nodiscard]] Shape without_front() const;
  bool operator==(const Shape& other) const;
  std::string str() const;  // "(3, 4)", "()"

 private:
  std::array<std::int64_t, kMaxRank> dims_{};
  int rank_ = 0;
};

// A view of an array owned elsewhere. Strides are in bytes. The layout is row-major and dense
// unless the owner sets other strides.
struct ArrayView {
  std::byte* data = nullptr;
  DType dtype = DType::kFloat32;
  Shape shape;
  std::array<std::int64_t, Shape::kMaxRank> strides{};

  static ArrayView dense(void* data, DType dtype, const Shape& shape);
  std::size_t bytes() const { return shape.size() * dtype_size(dtype); }
};

// A dense, zero-initialised, 64-byte aligned array [B, ...] whose address never changes.
class Array {
 public:
  Array() = default;
  Array(DType dtype, const Shape& shape);
  // Shares the memory of `owner`, which must outlive the result. `shape` must have the same number
  // of rows and of bytes per row.
  [[nodiscard]] static Array shared(Array& owner, DType dtype, const Shape& shape);

  [[nodiscard]] bool empty() const { return data_ == nullptr; }
  DType dtype() const { return dtype_; }
  const Shape& shape() const { return shape_; }
  std::size_t bytes() const { return shape_.size() * dtype_size(dtype_); }
  std::size_t row_bytes() const { return row_elements_ * dtype_size(dtype_); }
  std::byte* data() { return data_.get(); }
  const std::byte* data() const { return data_.get(); }
  // Row of world w, 0 <= w < B. Builds with assertions abort if there is no such world.
  std::byte* row_data(int w) { return data_.get() + row_begin(w); }
  const std::byte* row_data(int w) const { return data_.get() + row_begin(w); }

  // Row w as a flat span. Throws RuntimeError if T is not the element type of the array.
  template <class T>
  std::span<T> row(int w) {
    check_type<T>();
    return {reinterpret_cast<T*>(row_data(w)), row_elements_};
  }
  template <class T>
  std::span<const T> row(int w) const {
    check_type<T>();
    return {reinterpret_cast<const T*>(row_data(w)), row_elements_};
  }
  template <class T>
  std::span<T> all() {
    check_type<T>();
    return {reinterpret_cast<T*>(data()), static_cast<std::size_t>(shape_.size())};
  }
  template <class T>
  std::span<const T> all() const {
    check_type<T>();
    return {reinterpret_cast<const T*>(data()), static_cast<std::size_t>(shape_.size())};
  }

  ArrayView view() { return ArrayView::dense(data_.get(), dtype_, shape_); }
  void fill_zero();

 private:
  std::size_t row_begin(int w) const {
    assert(w >= 0 && shape_.rank() > 0 && w < shape_[0] &&
           "Array: the world index is out of range");
    return w * row_bytes();
  }
  template <class T>
  void check_type() const {
    if (dtype_of<T>() != dtype_) [[unlikely]]
      throw_type_mismatch(dtype_of<T>());
  }
  [[noreturn]] void throw_type_mismatch(DType asked) const;

  struct Free {
    Free() : owned(true) {}
    explicit Free(bool owned) : owned(owned) {}
    bool owned;
    void operator()(std::byte* p) const;
  };
  std::unique_ptr<std::byte[], Free> data_;
  DType dtype_ = DType::kFloat32;
  Shape shape_;
  std::size_t row_elements_ = 0;
};

}  // namespace mjsense
