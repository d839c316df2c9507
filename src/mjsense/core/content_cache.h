// SPDX-License-Identifier: Apache-2.0
#pragma once
// Process-wide cache of immutable objects built from large arrays. Equal arrays share one object,
// even across simulations.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <utility>

namespace mjsense {

// 128-bit hash (XXH3) of all added values, in order. Equal content has equal keys.
class ContentKey {
 public:
  template <class T>
  ContentKey& add(std::span<T> values) {
    add_bytes(std::as_bytes(values));
    return *this;
  }
  auto operator<=>(const ContentKey&) const = default;

 private:
  void add_bytes(std::span<const std::byte> bytes);

  std::uint64_t low_ = 0, high_ = 0;
};

// 64-bit hash (XXH3) that also depends on `seed`.
[[nodiscard]] std::uint64_t hash_of(std::span<const std::byte> bytes, std::uint64_t seed);

// Cache of objects of one type. An object is released with its last owner, except for the objects
// that were used last. Thread-safe; if two threads build the same object at the same time, the
// first result is kept.
template <class T>
class ContentCache {
 public:
  // `most`: how many objects stay without an owner.
  explicit ContentCache(std::size_t most = 0) : most_(most) {}

  template <class Make>
  std::shared_ptr<const T> get(const ContentKey& key, Make&& make) {
    if (auto found = find(key)) return found;
    std::shared_ptr<const T> made = std::forward<Make>(make)();
    const std::lock_guard lock(mutex_);
    std::erase_if(kept_, [](const auto& entry) { return entry.second.expired(); });
    std::weak_ptr<const T>& place = kept_[key];
    if (auto first = place.lock()) return first;
    place = made;
    return used(made);
  }

 private:
  std::shared_ptr<const T> find(const ContentKey& key) {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(key);
    return found == kept_.end() ? nullptr : used(found->second.lock());
  }

  std::shared_ptr<const T> used(std::shared_ptr<const T> object) {
    if (most_ > 0 && object) {
      std::erase(last_, object);
      last_.push_back(object);
      if (last_.size() > most_) last_.pop_front();
    }
    return object;
  }

  std::size_t most_;
  std::mutex mutex_;
  std::map<ContentKey, std::weak_ptr<const T>> kept_;
  std::deque<std::shared_ptr<const T>> last_;
};

}  // namespace mjsense
