// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/deflate.h"

#include <libdeflate.h>

#include <memory>
#include <new>

namespace mjsense {
namespace {

// A compressor has tables of about a megabyte, so each thread keeps that of its last level.
libdeflate_compressor* compressor(int level) {
  struct Free {
    void operator()(libdeflate_compressor* c) const { libdeflate_free_compressor(c); }
  };
  static thread_local std::unique_ptr<libdeflate_compressor, Free> kept;
  static thread_local int kept_level = -1;
  if (kept_level != level) {
    kept.reset(libdeflate_alloc_compressor(level));
    kept_level = kept ? level : -1;
    if (!kept) throw std::bad_alloc();
  }
  return kept.get();
}

libdeflate_decompressor* decompressor() {
  struct Free {
    void operator()(libdeflate_decompressor* d) const { libdeflate_free_decompressor(d); }
  };
  static thread_local std::unique_ptr<libdeflate_decompressor, Free> kept;
  if (!kept) kept.reset(libdeflate_alloc_decompressor());
  if (!kept) throw std::bad_alloc();
  return kept.get();
}

}  // namespace

std::span<const std::uint8_t> deflated(std::span<const std::uint8_t> bytes, int level,
                                       DeflateFormat format) {
  static thread_local std::vector<std::uint8_t> out;
  const bool raw = format == DeflateFormat::kRaw;
  libdeflate_compressor* const c = compressor(level);
  out.resize(
      (raw ? libdeflate_deflate_compress_bound : libdeflate_zlib_compress_bound)(c, bytes.size()));
  const std::size_t size = (raw ? libdeflate_deflate_compress : libdeflate_zlib_compress)(
      c, bytes.data(), bytes.size(), out.data(), out.size());
  return {out.data(), size};
}

std::vector<std::uint8_t> inflated(std::span<const std::uint8_t> packed, std::size_t maximum) {
  std::vector<std::uint8_t> out(maximum);
  std::size_t size = 0;
  const libdeflate_result result = libdeflate_zlib_decompress(
      decompressor(), packed.data(), packed.size(), out.data(), maximum, &size);
  out.resize(result == LIBDEFLATE_SUCCESS ? size : 0);
  return out;
}

std::uint32_t crc32_of(std::uint32_t crc, const void* bytes, std::size_t count) {
  return libdeflate_crc32(crc, bytes, count);
}

}  // namespace mjsense
