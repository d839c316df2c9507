// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/crc32.h"

#include <zlib.h>

#include "mjsense/core/cpu.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace mjsense {
namespace detail {

std::uint32_t crc32_portable(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count) {
  return static_cast<std::uint32_t>(crc32_z(crc, bytes, count));
}

#if defined(__x86_64__)
namespace {

// Bytes are polynomials over GF(2); their first bit, the lowest of the first byte, has the highest
// power. So in a register of n bits, bit i stands for x^(n - 1 - i). The CRC is the remainder by
//   P = x^32 + x^26 + x^23 + x^22 + x^16 + x^12 + x^11 + x^10 + x^8 + x^7 + x^5 + x^4 + x^2 + x + 1
constexpr std::uint32_t kP = 0xEDB88320;

// x^n mod P, in 64 bits.
constexpr std::int64_t power(int n) {
  std::uint32_t at = 1U << 31;  // x^0
  for (int i = 0; i < n; ++i) at = at >> 1 ^ (at & 1 ? kP : 0);
  return static_cast<std::int64_t>(std::uint64_t{at} << 32);
}

// What multiplies s = h x^64 + l by x^n, as h x^(64 + n) + l x^n, for each of four s. The product of
// two registers of 64 bits has 127 bits and stands one power too high in one of 128: here one less.
struct Powers {
  std::int64_t bits[8];
};
constexpr Powers powers(int n) {
  const std::int64_t low = power(64 + n - 1), high = power(n - 1);
  return {{low, high, low, high, low, high, low, high}};
}

// Registers hold one polynomial below x^128 or four of them.
constexpr int kLanes = 4;                        // so many multiplications are under way at a time
constexpr std::size_t kNarrow = 16, kWide = 64;  // bytes of a register

#define MJSENSE_NARROW __attribute__((target("pclmul,sse4.1")))
#define MJSENSE_WIDE __attribute__((target("avx512f,vpclmulqdq,pclmul,sse4.1")))

MJSENSE_NARROW inline __m128i load(const void* bytes) {
  return _mm_loadu_si128(static_cast<const __m128i*>(bytes));
}
MJSENSE_WIDE inline __m512i load_wide(const void* bytes) { return _mm512_loadu_si512(bytes); }

// What is congruent to s x^n, plus what stands there.
MJSENSE_NARROW inline __m128i shifted(__m128i s, __m128i powers, __m128i there) {
  return _mm_xor_si128(there, _mm_xor_si128(_mm_clmulepi64_si128(s, powers, 0x00),
                                            _mm_clmulepi64_si128(s, powers, 0x11)));
}
MJSENSE_WIDE inline __m512i shifted_wide(__m512i s, __m512i powers, __m512i there) {
  return _mm512_ternarylogic_epi64(there, _mm512_clmulepi64_epi128(s, powers, 0x00),
                                   _mm512_clmulepi64_epi128(s, powers, 0x11), 0x96);
}

// V. Gopal et al., Fast CRC Computation for Generic Polynomials Using PCLMULQDQ Instruction, Intel,
// 2009: what was read is shifted over a block ahead and added to it, so that from there on the
// remainder is the same without it.
MJSENSE_NARROW std::uint32_t narrow(std::uint32_t crc, const std::uint8_t* bytes,
                                    std::size_t count) {
  constexpr std::size_t kBlock = kLanes * kNarrow;
  constexpr Powers kOfBlock = powers(8 * kBlock), kOfNext = powers(8 * kNarrow);
  if (count < 2 * kBlock) return crc32_portable(crc, bytes, count);
  __m128i lane[kLanes];
  for (int i = 0; i < kLanes; ++i) lane[i] = load(bytes + i * kNarrow);
  lane[0] = _mm_xor_si128(lane[0], _mm_cvtsi32_si128(static_cast<int>(~crc)));
  const __m128i block = load(kOfBlock.bits), next = load(kOfNext.bits);
  for (bytes += kBlock, count -= kBlock; count >= kBlock; bytes += kBlock, count -= kBlock) {
    for (int i = 0; i < kLanes; ++i) lane[i] = shifted(lane[i], block, load(bytes + i * kNarrow));
  }
  for (int i = 1; i < kLanes; ++i) lane[i] = shifted(lane[i - 1], next, lane[i]);
  // Sixteen bytes that stand for all until here, with nothing before them.
  std::uint8_t same[kNarrow];
  _mm_storeu_si128(reinterpret_cast<__m128i*>(same), lane[kLanes - 1]);
  return crc32_portable(crc32_portable(~0U, same, kNarrow), bytes, count);
}

MJSENSE_WIDE std::uint32_t wide(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count) {
  constexpr std::size_t kBlock = kLanes * kWide;
  constexpr Powers kOfBlock = powers(8 * kBlock), kOfNext = powers(8 * kWide);
  if (count < 2 * kBlock) return narrow(crc, bytes, count);
  __m512i lane[kLanes];
  for (int i = 0; i < kLanes; ++i) lane[i] = load_wide(bytes + i * kWide);
  lane[0] = _mm512_xor_si512(lane[0], _mm512_set_epi64(0, 0, 0, 0, 0, 0, 0, std::int64_t{~crc}));
  const __m512i block = load_wide(kOfBlock.bits), next = load_wide(kOfNext.bits);
  for (bytes += kBlock, count -= kBlock; count >= kBlock; bytes += kBlock, count -= kBlock) {
    for (int i = 0; i < kLanes; ++i)
      lane[i] = shifted_wide(lane[i], block, load_wide(bytes + i * kWide));
  }
  for (int i = 1; i < kLanes; ++i) lane[i] = shifted_wide(lane[i - 1], next, lane[i]);
  std::uint8_t same[kWide];
  _mm512_storeu_si512(same, lane[kLanes - 1]);
  return narrow(narrow(~0U, same, kWide), bytes, count);
}

}  // namespace
#endif

std::vector<Crc32> crc32_multiplying() {
  std::vector<Crc32> fast;
#if defined(__x86_64__)
  if (cpu_isa() >= Isa::kAvx2 && __builtin_cpu_supports("pclmul")) fast.push_back(narrow);
  if (cpu_isa() >= Isa::kAvx512 && __builtin_cpu_supports("vpclmulqdq")) fast.push_back(wide);
#endif
  return fast;
}

}  // namespace detail

std::uint32_t crc32_of(std::uint32_t crc, const void* bytes, std::size_t count) {
  static const detail::Crc32 best = [] {
    const std::vector<detail::Crc32> fast = detail::crc32_multiplying();
    return fast.empty() ? detail::crc32_portable : fast.back();
  }();
  return best(crc, static_cast<const std::uint8_t*>(bytes), count);
}

}  // namespace mjsense
