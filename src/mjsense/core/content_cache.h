// SPDX-License-Identifier: Apache-2.0
#pragma once
// Process-wide cache of immutable objects built from large arrays. Equal arrays share one object,
// even across simulations.

#include <bit>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <utility>

namespace mjsense {

// 128-bit hash of all added values, in order. Equal content has equal keys.
class ContentKey {
 public:
  template <class T>
  ContentKey& add(std::span<T> values) {
    own_.mix(values.size());
    const auto bytes = std::as_bytes(values);
    std::size_t at = 0;
    // Each step of a hash waits for the step before it, so large arrays have several hashes in turns.
    if (constexpr std::size_t kRow = 8 * kParts; bytes.size() >= 8 * kRow) {
      Hash parts[kParts];
      for (; at + kRow <= bytes.size(); at += kRow)
        for (std::size_t i = 0; i < kParts; ++i) parts[i].mix(word(bytes.data() + at + 8 * i, 8));
      for (const Hash& part : parts) {
        own_.mix(part.a);
        own_.mix(part.b);
      }
    }
    for (; at + 8 <= bytes.size(); at += 8) own_.mix(word(bytes.data() + at, 8));
    if (at < bytes.size()) own_.mix(word(bytes.data() + at, bytes.size() - at));
    return *this;
  }
  auto operator<=>(const ContentKey&) const = default;

 private:
  static constexpr std::size_t kParts = 4;
  struct Hash {
    std::uint64_t a = 0x243F6A8885A308D3u, b = 0x13198A2E03707344u;

    void mix(std::uint64_t w) {
      a = std::rotl((a ^ w) * 0x9E3779B97F4A7C15u, 29);
      b = std::rotl((b + w) * 0xC2B2AE3D27D4EB4Fu, 31) ^ a;
    }
    auto operator<=>(const Hash&) const = default;
  };
  static std::uint64_t word(const std::byte* from, std::size_t count) {
    std::uint64_t w = 0;
    std::memcpy(&w, from, count);
    return w;
  }

  Hash own_;
};

// Cache of objects of one type. It holds weak references only, so an object is released with its
// last owner. Thread-safe; if two threads build the same object at the same time, the first result
// is kept.
template <class T>
class ContentCache {
 public:
  template <class Make>
  std::shared_ptr<const T> get(const ContentKey& key, Make&& make) {
    if (auto found = find(key)) return found;
    std::shared_ptr<const T> made = std::forward<Make>(make)();
    const std::lock_guard lock(mutex_);
    std::erase_if(kept_, [](const auto& entry) { return entry.second.expired(); });
    std::weak_ptr<const T>& place = kept_[key];
    if (auto first = place.lock()) return first;
    place = made;
    return made;
  }

 private:
  std::shared_ptr<const T> find(const ContentKey& key) {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(key);
    return found == kept_.end() ? nullptr : found->second.lock();
  }

  std::mutex mutex_;
  std::map<ContentKey, std::weak_ptr<const T>> kept_;
};

}  // namespace mjsense
