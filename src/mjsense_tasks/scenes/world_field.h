// SPDX-License-Identifier: Apache-2.0
#pragma once
// A field of the model, of which each world of a batch has its own values.

#include <mujoco/mjbatch.h>

#include <algorithm>
#include <cstddef>

namespace mjsense::tasks::scenes {

template <class T>
class WorldField {
 public:
  // Gives each world its own values, which are those of `model` until they are written. A second
  // call has no effect.
  void expand(mjBatch* batch, const char* name, const T* model) {
    if (rows_) return;
    rows_ = static_cast<T*>(mjb_expand(batch, name, &size_, nullptr));
    model_ = model;
  }
  explicit operator bool() const { return rows_ != nullptr; }
  T* of(int world) const { return rows_ + static_cast<std::ptrdiff_t>(world) * size_; }
  // Gives the world the model's values.
  void reset(int world) const {
    if (rows_) std::copy_n(model_, size_, of(world));
  }

 private:
  T* rows_ = nullptr;
  const T* model_ = nullptr;
  int size_ = 0;
};

}  // namespace mjsense::tasks::scenes
