// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/chunk_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/files/deflate.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/hdf5/lzf.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {
namespace {

constexpr std::uint64_t kMaxChunks = 1'000'000;
// The library counts chunks from the first one for each query, so the cost is quadratic.
constexpr hsize_t kMaxPlainChunks = 10'000;
constexpr std::size_t kSumBytes = 4;  // fletcher32's checksum follows the data

using Bytes = std::vector<std::uint8_t>;

Bytes lzf_unpacked(const Bytes& packed, std::size_t maximum) {
  Bytes out(maximum);
  out.resize(lzf_unpack(packed, out));
  return out;
}

class Chunks {
 public:
  Chunks(hid_t dataset, const std::string& name)
      : dataset_(dataset),
        name_(name),
        properties_(H5Dget_create_plist(dataset), H5Pclose, name),
        size_(dims(dataset)) {}

  void check() {
    if (H5Pget_layout(properties_) != H5D_CHUNKED) return;
    const Id type(H5Dget_type(dataset_), H5Tclose, name_);
    std::vector<hsize_t> chunk(size_.size());
    hdf5::check(H5Pget_chunk(properties_, static_cast<int>(chunk.size()), chunk.data()), name_);
    bytes_ = H5Tget_size(type);
    for (const hsize_t n : chunk) bytes_ *= n;  // check_storage() has limited both factors
    if (!read_filters()) return check_plain();
    std::uint64_t count = 1;
    for (std::size_t i = 0; i < size_.size(); ++i) {
      if (__builtin_mul_overflow(count, (size_[i] + chunk[i] - 1) / chunk[i], &count) ||
          count > kMaxChunks)
        refuse(name_, fmt::format("has more than {} chunks", kMaxChunks));
    }
    std::vector<hsize_t> at(size_.size(), 0);
    for (std::uint64_t n = 0; n < count; ++n) {
      check_chunk(at);
      for (std::size_t i = at.size(); i-- > 0;) {
        at[i] += chunk[i];
        if (at[i] < size_[i]) break;
        at[i] = 0;
      }
    }
  }

 private:
  // Returns false if there are no filters.
  bool read_filters() {
    for (int i = 0; i < H5Pget_nfilters(properties_); ++i) {
      unsigned flags = 0, config = 0;
      std::size_t values = 0;
      const H5Z_filter_t filter = H5Pget_filter2(properties_, static_cast<unsigned>(i), &flags,
                                                 &values, nullptr, 0, nullptr, &config);
      if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE &&
          filter != H5Z_FILTER_FLETCHER32 && filter != kLzfFilter)
        refuse(name_,
               fmt::format("is compressed with filter {}, which is not supported: gzip and lzf are",
                           static_cast<int>(filter)));
      filters_.push_back(filter);
    }
    return !filters_.empty();
  }

  // The index stores a size for chunks without filters too, but H5Dget_chunk_storage_size() does
  // not return it.
  void check_plain() const {
    const Id space(H5Dget_space(dataset_), H5Sclose, name_);
    hsize_t count = 0;
    hdf5::check(H5Dget_num_chunks(dataset_, space, &count), name_);
    if (count > kMaxPlainChunks)
      refuse(name_, fmt::format("has more than {} uncompressed chunks", kMaxPlainChunks));
    std::vector<hsize_t> at(size_.size());
    for (hsize_t n = 0; n < count; ++n) {
      unsigned without = 0;
      haddr_t address = 0;
      hsize_t stored = 0;
      hdf5::check(H5Dget_chunk_info(dataset_, space, n, at.data(), &without, &address, &stored),
                  name_);
      if (stored != bytes_)
        refuse(name_, fmt::format("is damaged: one of its chunks has {} bytes, expected {}", stored,
                                  bytes_));
    }
  }

  void check_chunk(const std::vector<hsize_t>& at) const {
    hsize_t stored = 0;
    hdf5::check(H5Dget_chunk_storage_size(dataset_, at.data(), &stored), name_);
    if (stored == 0) return;
    if (stored > kMaxRowBytes + (kMaxRowBytes >> 4))
      refuse(name_, fmt::format("has a compressed chunk of {} bytes, which is too large", stored));
    Bytes bytes(stored);
    std::uint32_t without = 0;  // a bit for each filter that was skipped
    hdf5::check(H5Dread_chunk(dataset_, H5P_DEFAULT, at.data(), &without, bytes.data()), name_);
    for (std::size_t i = filters_.size(); i-- > 0;) {
      if (without >> i & 1) continue;
      const std::size_t maximum = bytes_ + kSumBytes * filters_.size();
      if (filters_[i] == H5Z_FILTER_DEFLATE) bytes = inflated(bytes, maximum);
      if (filters_[i] == kLzfFilter) bytes = lzf_unpacked(bytes, maximum);
      if (filters_[i] == H5Z_FILTER_FLETCHER32)
        bytes.resize(bytes.size() - std::min(bytes.size(), kSumBytes));
    }
    if (bytes.size() != bytes_)
      refuse(name_,
             fmt::format("is damaged: one of its chunks does not decompress to {} bytes", bytes_));
  }

  hid_t dataset_;
  const std::string& name_;
  Id properties_;
  std::vector<hsize_t> size_;
  std::vector<H5Z_filter_t> filters_;  // in the order in which they were applied
  std::size_t bytes_ = 0;              // size of an unpacked chunk
};

}  // namespace

void check_chunks(hid_t dataset, const std::string& name) { Chunks(dataset, name).check(); }

}  // namespace mjsense::hdf5
