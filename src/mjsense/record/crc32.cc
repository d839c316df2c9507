// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/crc32.h"

#include <zlib.h>

#include <cstring>

#include "mjsense/core/system/cpu.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace mjsense::record {
namespace detail {

std::uint32_t crc32_portable(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count) {
  return static_cast<std::uint32_t>(crc32_z(crc, bytes, count));
}

#if defined(__x86_64__)
namespace {

// Bytes are polynomials over GF(2). Their first bit, the lowest bit of the first byte, is the
// coefficient of the highest power. In a register of n bits, bit i is the coefficient of
// x^(n - 1 - i). The CRC is the remainder of the division by
//
//   P = x^32 + x^26 + x^23 + x^22 + x^16 + x^12 + x^11 + x^10 + x^8 + x^7 + x^5 + x^4 + x^2 + x + 1
constexpr std::uint32_t kP = 0xEDB88320;

// x^n mod P, in a 64-bit register.
constexpr std::int64_t power(int n) {
  std::uint32_t at = 1U << 31;  // x^0
  for (int i = 0; i < n; ++i) at = at >> 1 ^ (at & 1 ? kP : 0);
  return static_cast<std::int64_t>(std::uint64_t{at} << 32);
}

// Values of 33 bits: P, and the quotient of x^64 / P without its remainder.
constexpr std::int64_t kWholeP = (std::int64_t{kP} << 1) | 1;
constexpr std::int64_t quotient() {
  std::int64_t of = 1;      // x^32, the first term of x^64 / P
  std::uint32_t rest = kP;  // remainder of x^32 / P, then of each higher power
  for (int i = 1; i <= 32; ++i) {
    if (rest & 1) of |= std::int64_t{1} << i;
    rest = rest >> 1 ^ (rest & 1 ? kP : 0);
  }
  return of;
}

// Factors that multiply s = h x^64 + l by x^n, as h x^(64 + n) + l x^n, for each of four
// polynomials s. The product of two 64-bit registers has 127 bits, which makes it one power too
// high in a 128-bit register. The exponents are therefore one lower.
struct Powers {
  std::int64_t bits[8];
};
constexpr Powers powers(int n) {
  const std::int64_t low = power(64 + n - 1), high = power(n - 1);
  return {{low, high, low, high, low, high, low, high}};
}

// A register holds one polynomial of degree below 128, or four of them.
constexpr int kLanes = 4;                        // independent multiplications in flight
constexpr std::size_t kNarrow = 16, kWide = 64;  // bytes per register

#define MJSENSE_NARROW __attribute__((target("pclmul,sse4.1")))
#define MJSENSE_WIDE __attribute__((target("avx512f,vpclmulqdq,pclmul,sse4.1")))

MJSENSE_NARROW inline __m128i load(const void* bytes) {
  return _mm_loadu_si128(static_cast<const __m128i*>(bytes));
}
MJSENSE_WIDE inline __m512i load_wide(const void* bytes) { return _mm512_loadu_si512(bytes); }

// Returns a polynomial congruent to s x^n + there, mod P.
MJSENSE_NARROW inline __m128i shifted(__m128i s, __m128i powers, __m128i there) {
  return _mm_xor_si128(there, _mm_xor_si128(_mm_clmulepi64_si128(s, powers, 0x00),
                                            _mm_clmulepi64_si128(s, powers, 0x11)));
}
MJSENSE_WIDE inline __m512i shifted_wide(__m512i s, __m512i powers, __m512i there) {
  return _mm512_ternarylogic_epi64(there, _mm512_clmulepi64_epi128(s, powers, 0x00),
                                   _mm512_clmulepi64_epi128(s, powers, 0x11), 0x96);
}

// V. Gopal et al., Fast CRC Computation for Generic Polynomials Using PCLMULQDQ Instruction, Intel,
// 2009. The block that was read is multiplied by a power of x (mod P) and added to a block further
// ahead. The remainder of the rest is then the same without it.

// Remaining bytes; the polynomial of all bytes before them is kept separately.
struct Rest {
  const std::uint8_t* bytes;
  std::size_t count;
};

// Consumes the first bytes, so that the remaining count is a multiple of kNarrow. `count` must be
// at least 2 * kNarrow. Leading zeros do not change the remainder.
MJSENSE_NARROW inline __m128i head(std::uint32_t crc, Rest& rest) {
  const std::size_t odd = rest.count % kNarrow;
  std::uint8_t aligned[2 * kNarrow] = {};
  std::uint8_t* first = aligned + kNarrow - odd;
  std::memcpy(first, rest.bytes, kNarrow);
  std::memcpy(aligned + kNarrow, rest.bytes + odd, kNarrow);
  std::uint32_t word;
  std::memcpy(&word, first, sizeof(word));
  word ^= ~crc;
  std::memcpy(first, &word, sizeof(word));
  rest.bytes += kNarrow + odd;
  rest.count -= kNarrow + odd;
  constexpr Powers kNext = powers(8 * kNarrow);
  return shifted(load(aligned), load(kNext.bits), load(aligned + kNarrow));
}

// Consumes the remaining bytes, a multiple of kNarrow, and returns the CRC.
MJSENSE_NARROW inline std::uint32_t tail(__m128i s, Rest rest) {
  constexpr Powers kNext = powers(8 * kNarrow);
  const __m128i next = load(kNext.bits);
  for (; rest.count > 0; rest.bytes += kNarrow, rest.count -= kNarrow)
    s = shifted(s, next, load(rest.bytes));
  // Reduces (h x^64 + l) x^32 to degree below 96, then below 64.
  const __m128i fold = _mm_set_epi64x(power(64 - 1), power(96 - 1));
  s = _mm_xor_si128(_mm_clmulepi64_si128(s, fold, 0x00), _mm_slli_si128(_mm_srli_si128(s, 8), 4));
  s = _mm_srli_si128(_mm_xor_si128(s, _mm_clmulepi64_si128(s, fold, 0x10)), 8);
  // Barrett reduction (P. Barrett): the quotient by P depends only on the upper half; its product
  // with P is subtracted.
  const __m128i by = _mm_set_epi64x(quotient(), kWholeP), half = _mm_set_epi32(0, 0, 0, -1);
  __m128i q = _mm_clmulepi64_si128(_mm_and_si128(s, half), by, 0x10);
  q = _mm_clmulepi64_si128(_mm_and_si128(q, half), by, 0x00);
  return ~static_cast<std::uint32_t>(_mm_extract_epi32(_mm_xor_si128(s, q), 1));
}

MJSENSE_NARROW std::uint32_t narrow(std::uint32_t crc, const std::uint8_t* bytes,
                                    std::size_t count) {
  constexpr std::size_t kBlock = kLanes * kNarrow;
  if (count < 2 * kNarrow) return crc32_portable(crc, bytes, count);
  Rest rest{bytes, count};
  __m128i s = head(crc, rest);
  if (rest.count >= 2 * kBlock) {
    constexpr Powers kOfBlock = powers(8 * kBlock), kNext = powers(8 * kNarrow);
    const __m128i block = load(kOfBlock.bits), next = load(kNext.bits);
    __m128i lane[kLanes];
    for (int i = 0; i < kLanes; ++i) lane[i] = load(rest.bytes + i * kNarrow);
    lane[0] = shifted(s, next, lane[0]);
    const auto step = [&] {
      rest.bytes += kBlock;
      rest.count -= kBlock;
    };
    for (step(); rest.count >= kBlock; step()) {
      for (int i = 0; i < kLanes; ++i)
        lane[i] = shifted(lane[i], block, load(rest.bytes + i * kNarrow));
    }
    s = lane[0];
    for (int i = 1; i < kLanes; ++i) s = shifted(s, next, lane[i]);
  }
  return tail(s, rest);
}

MJSENSE_WIDE std::uint32_t wide(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count) {
  constexpr std::size_t kBlock = kLanes * kWide;
  if (count < 2 * kBlock) return narrow(crc, bytes, count);
  Rest rest{bytes, count};
  const __m128i first = head(crc, rest);
  constexpr Powers kOfBlock = powers(8 * kBlock), kOfWide = powers(8 * kWide);
  constexpr Powers kNext = powers(8 * kNarrow);
  const __m512i block = load_wide(kOfBlock.bits), wide = load_wide(kOfWide.bits);
  const __m128i next = load(kNext.bits);
  __m512i lane[kLanes];
  for (int i = 0; i < kLanes; ++i) lane[i] = load_wide(rest.bytes + i * kWide);
  const __m128i zero = _mm_setzero_si128();
  lane[0] = _mm512_xor_si512(lane[0], _mm512_zextsi128_si512(shifted(first, next, zero)));
  const auto step = [&](std::size_t n) {
    rest.bytes += n;
    rest.count -= n;
  };
  for (step(kBlock); rest.count >= kBlock; step(kBlock)) {
    for (int i = 0; i < kLanes; ++i)
      lane[i] = shifted_wide(lane[i], block, load_wide(rest.bytes + i * kWide));
  }
  for (int i = 1; i < kLanes; ++i) lane[i] = shifted_wide(lane[i - 1], wide, lane[i]);
  __m512i all = lane[kLanes - 1];
  for (; rest.count >= kWide; step(kWide)) all = shifted_wide(all, wide, load_wide(rest.bytes));
  std::uint8_t quarters[kWide];
  _mm512_storeu_si512(quarters, all);
  __m128i s = load(quarters);
  for (std::size_t i = kNarrow; i < kWide; i += kNarrow) s = shifted(s, next, load(quarters + i));
  return tail(s, rest);
}

}  // namespace
#endif

std::vector<Crc32> crc32_clmul() {
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
    const std::vector<detail::Crc32> fast = detail::crc32_clmul();
    return fast.empty() ? detail::crc32_portable : fast.back();
  }();
  return best(crc, static_cast<const std::uint8_t*>(bytes), count);
}

}  // namespace mjsense::record
