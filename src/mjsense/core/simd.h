// SPDX-License-Identifier: Apache-2.0
#pragma once
// Vectors of kWidth floats for the kernels: AVX-512 (16 lanes), AVX2 (8), or plain arrays of 4 that
// any compiler vectorises (SSE2, NEON). All code is in an unnamed namespace, because each instruction set must
// keep its own copy. Highway is not used: three widths take 341 lines here and compile a fifth
// faster, and bit-identical results on all instruction sets depend on the rounding of these
// functions.

#if defined(__AVX512F__) || defined(__AVX2__)
#include <immintrin.h>
#endif

#include <cmath>
#include <cstdint>
#include <cstring>

namespace mjsense {
namespace {

// Four floats, for code that works lane by lane.
typedef float Float4 __attribute__((vector_size(16)));

inline Float4 load4(const float* p) {
  Float4 x;
  std::memcpy(&x, p, sizeof x);
  return x;
}
// p[1], p[2], p[3]; the last element is unspecified.
inline Float4 last3(const float* p) {
  const Float4 x = load4(p);
  return __builtin_shufflevector(x, x, 1, 2, 3, 3);
}

#if defined(__AVX512F__)

constexpr int kWidth = 16;

struct Mask {
  __mmask16 m;
};
struct Int {
  __m512i v;
};
struct Float {
  __m512 v;
  Float() = default;
  Float(__m512 x) : v(x) {}
  Float(float x) : v(_mm512_set1_ps(x)) {}
};

inline Float load(const float* p) { return _mm512_load_ps(p); }
inline Float loadu(const float* p) { return _mm512_loadu_ps(p); }
inline void store(float* p, Float x) { _mm512_store_ps(p, x.v); }
inline void store(int* p, Int x) { _mm512_store_si512(p, x.v); }
inline Int load(const int* p) { return {_mm512_load_si512(p)}; }
inline Int int_of(int x) { return {_mm512_set1_epi32(x)}; }
inline Float operator+(Float a, Float b) { return _mm512_add_ps(a.v, b.v); }
inline Float operator-(Float a, Float b) { return _mm512_sub_ps(a.v, b.v); }
inline Float operator*(Float a, Float b) { return _mm512_mul_ps(a.v, b.v); }
inline Float operator/(Float a, Float b) { return _mm512_div_ps(a.v, b.v); }
inline Float operator-(Float a) {
  return _mm512_castsi512_ps(
      _mm512_xor_si512(_mm512_castps_si512(a.v), _mm512_set1_epi32(int(0x80000000u))));
}
inline Float fma(Float a, Float b, Float c) { return _mm512_fmadd_ps(a.v, b.v, c.v); }
inline Float min(Float a, Float b) { return _mm512_min_ps(a.v, b.v); }
inline Float max(Float a, Float b) { return _mm512_max_ps(a.v, b.v); }
inline Float sqrt(Float a) { return _mm512_sqrt_ps(a.v); }
inline Float abs(Float a) { return _mm512_abs_ps(a.v); }
inline Mask operator<(Float a, Float b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
inline Mask operator<=(Float a, Float b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)}; }
inline Mask operator&(Mask a, Mask b) { return {static_cast<__mmask16>(a.m & b.m)}; }
inline Mask operator|(Mask a, Mask b) { return {static_cast<__mmask16>(a.m | b.m)}; }
inline Mask operator~(Mask a) { return {static_cast<__mmask16>(~a.m)}; }
inline std::uint32_t bits(Mask a) {
  // A plain `return a.m` is not safe: GCC 12 may spill the 16 bits and read back 32.
  std::uint32_t b;
  __asm__("kmovw %1, %0" : "=r"(b) : "k"(a.m));
  return b;
}
inline Mask mask_of(std::uint32_t b) { return {static_cast<__mmask16>(b)}; }
inline Float select(Mask m, Float a, Float b) { return _mm512_mask_blend_ps(m.m, b.v, a.v); }
inline Int select(Mask m, Int a, Int b) { return {_mm512_mask_blend_epi32(m.m, b.v, a.v)}; }
inline Mask less(Int a, Int b) { return {_mm512_cmplt_epi32_mask(a.v, b.v)}; }
inline Mask operator==(Int a, Int b) { return {_mm512_cmpeq_epi32_mask(a.v, b.v)}; }
inline Int operator+(Int a, Int b) { return {_mm512_add_epi32(a.v, b.v)}; }
inline Int operator*(Int a, Int b) { return {_mm512_mullo_epi32(a.v, b.v)}; }
inline Int truncate(Float a) { return {_mm512_cvttps_epi32(a.v)}; }
inline Float to_float(Int a) { return _mm512_cvtepi32_ps(a.v); }
inline Float floor(Float a) {
  return _mm512_roundscale_ps(a.v, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
}
inline Float gather(const float* p, Int i) { return _mm512_i32gather_ps(i.v, p, 4); }
inline Int gather(const int* p, Int i) { return {_mm512_i32gather_epi32(i.v, p, 4)}; }
// first = p[i], second = p[i + 1].
inline void gather_pairs(const std::uint32_t* p, Int i, Int& first, Int& second) {
  const __m512i low = _mm512_i32gather_epi64(_mm512_castsi512_si256(i.v), p, 4);
  const __m512i high = _mm512_i32gather_epi64(_mm512_extracti64x4_epi64(i.v, 1), p, 4);
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  first = {_mm512_permutex2var_epi32(low, even, high)};
  second = {_mm512_permutex2var_epi32(low, _mm512_add_epi32(even, _mm512_set1_epi32(1)), high)};
}
// Returns `a` unchanged, and keeps the compiler from fusing its product with a following addition.
inline Float rounded(Float a) {
  __asm__("" : "+v"(a.v));
  return a;
}
// float(by + double(a))
inline Float shifted(double by, Float a) {
  const __m512d b = _mm512_set1_pd(by);
  const __m512d low = _mm512_add_pd(b, _mm512_cvtps_pd(_mm512_castps512_ps256(a.v)));
  const __m512d high = _mm512_add_pd(b, _mm512_cvtps_pd(_mm512_extractf32x8_ps(a.v, 1)));
  return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high), 1);
}
// Writes x, y, z of the first lane, then of the second...
inline void store_rows(float* p, Float x, Float y, Float z) {
  const auto of = [&](__m512i xy, __m512i with_z) {
    return _mm512_permutex2var_ps(_mm512_permutex2var_ps(x.v, xy, y.v), with_z, z.v);
  };
  _mm512_store_ps(p,
                  of(_mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5),
                     _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15)));
  _mm512_store_ps(p + 16,
                  of(_mm512_setr_epi32(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26),
                     _mm512_setr_epi32(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15)));
  _mm512_store_ps(p + 32,
                  of(_mm512_setr_epi32(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0),
                     _mm512_setr_epi32(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31)));
}
inline float lane_min(Float a) { return _mm512_reduce_min_ps(a.v); }
// `from` less half of the bits of a, as the bits of a number.
inline Float half_exponent(int from, Float a) {
  const __m512i half = _mm512_srli_epi32(_mm512_castps_si512(a.v), 1);
  return _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(from), half));
}
inline float first_lane(Float a) { return _mm512_cvtss_f32(a.v); }

#elif defined(__AVX2__)

constexpr int kWidth = 8;

struct Mask {
  __m256 m;
};
struct Int {
  __m256i v;
};
struct Float {
  __m256 v;
  Float() = default;
  Float(__m256 x) : v(x) {}
  Float(float x) : v(_mm256_set1_ps(x)) {}
};

inline Float load(const float* p) { return _mm256_load_ps(p); }
inline Float loadu(const float* p) { return _mm256_loadu_ps(p); }
inline void store(float* p, Float x) { _mm256_store_ps(p, x.v); }
inline void store(int* p, Int x) { _mm256_store_si256(reinterpret_cast<__m256i*>(p), x.v); }
inline Int load(const int* p) { return {_mm256_load_si256(reinterpret_cast<const __m256i*>(p))}; }
inline Int int_of(int x) { return {_mm256_set1_epi32(x)}; }
inline Float operator+(Float a, Float b) { return _mm256_add_ps(a.v, b.v); }
inline Float operator-(Float a, Float b) { return _mm256_sub_ps(a.v, b.v); }
inline Float operator*(Float a, Float b) { return _mm256_mul_ps(a.v, b.v); }
inline Float operator/(Float a, Float b) { return _mm256_div_ps(a.v, b.v); }
inline Float operator-(Float a) { return _mm256_xor_ps(a.v, _mm256_set1_ps(-0.0f)); }
inline Float fma(Float a, Float b, Float c) { return _mm256_fmadd_ps(a.v, b.v, c.v); }
inline Float min(Float a, Float b) { return _mm256_min_ps(a.v, b.v); }
inline Float max(Float a, Float b) { return _mm256_max_ps(a.v, b.v); }
inline Float sqrt(Float a) { return _mm256_sqrt_ps(a.v); }
inline Float abs(Float a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a.v); }
inline Mask operator<(Float a, Float b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)}; }
inline Mask operator<=(Float a, Float b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LE_OQ)}; }
inline Mask operator&(Mask a, Mask b) { return {_mm256_and_ps(a.m, b.m)}; }
inline Mask operator|(Mask a, Mask b) { return {_mm256_or_ps(a.m, b.m)}; }
inline Mask operator~(Mask a) {
  return {_mm256_xor_ps(a.m, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))};
}
inline std::uint32_t bits(Mask a) { return static_cast<std::uint32_t>(_mm256_movemask_ps(a.m)); }
inline Mask mask_of(std::uint32_t b) {
  const __m256i lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i set = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(b)), lanes);
  return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lanes))};
}
inline Float select(Mask m, Float a, Float b) { return _mm256_blendv_ps(b.v, a.v, m.m); }
inline Int select(Mask m, Int a, Int b) {
  return {_mm256_castps_si256(
      _mm256_blendv_ps(_mm256_castsi256_ps(b.v), _mm256_castsi256_ps(a.v), m.m))};
}
inline Mask less(Int a, Int b) { return {_mm256_castsi256_ps(_mm256_cmpgt_epi32(b.v, a.v))}; }
inline Mask operator==(Int a, Int b) { return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(a.v, b.v))}; }
inline Int operator+(Int a, Int b) { return {_mm256_add_epi32(a.v, b.v)}; }
inline Int operator*(Int a, Int b) { return {_mm256_mullo_epi32(a.v, b.v)}; }
inline Int truncate(Float a) { return {_mm256_cvttps_epi32(a.v)}; }
inline Float to_float(Int a) { return _mm256_cvtepi32_ps(a.v); }
inline Float floor(Float a) { return _mm256_floor_ps(a.v); }
inline Float gather(const float* p, Int i) { return _mm256_i32gather_ps(p, i.v, 4); }
inline Int gather(const int* p, Int i) { return {_mm256_i32gather_epi32(p, i.v, 4)}; }
// Loads one pair at a time: on a Zen 3, textured images take 0.94 of the time they take with
// gathers of pairs.
inline void gather_pairs(const std::uint32_t* p, Int i, Int& first, Int& second) {
  alignas(32) int at[kWidth];
  store(at, i);
  const auto two = [&](int k) {
    const __m128 one =
        _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p + at[k])));
    return _mm_loadh_pi(one, reinterpret_cast<const __m64*>(p + at[k + 1]));
  };
  const __m256 even = _mm256_set_m128(two(4), two(0)), odd = _mm256_set_m128(two(6), two(2));
  first = {_mm256_castps_si256(_mm256_shuffle_ps(even, odd, _MM_SHUFFLE(2, 0, 2, 0)))};
  second = {_mm256_castps_si256(_mm256_shuffle_ps(even, odd, _MM_SHUFFLE(3, 1, 3, 1)))};
}
inline Float rounded(Float a) {
  __asm__("" : "+x"(a.v));
  return a;
}
inline Float shifted(double by, Float a) {
  const __m256d b = _mm256_set1_pd(by);
  const __m256d low = _mm256_add_pd(b, _mm256_cvtps_pd(_mm256_castps256_ps128(a.v)));
  const __m256d high = _mm256_add_pd(b, _mm256_cvtps_pd(_mm256_extractf128_ps(a.v, 1)));
  return _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low));
}
inline void store_rows(float* p, Float x, Float y, Float z) {
  // Contents of each half, for its lanes 0 1 2 3: x0 x2 y0 y2, y1 y3 z1 z3, z0 z2 x1 x3.
  const __m256 xy = _mm256_shuffle_ps(x.v, y.v, _MM_SHUFFLE(2, 0, 2, 0));
  const __m256 yz = _mm256_shuffle_ps(y.v, z.v, _MM_SHUFFLE(3, 1, 3, 1));
  const __m256 zx = _mm256_shuffle_ps(z.v, x.v, _MM_SHUFFLE(3, 1, 2, 0));
  const __m256 a = _mm256_shuffle_ps(xy, zx, _MM_SHUFFLE(2, 0, 2, 0));  // x0 y0 z0 x1
  const __m256 b = _mm256_shuffle_ps(yz, xy, _MM_SHUFFLE(3, 1, 2, 0));  // y1 z1 x2 y2
  const __m256 c = _mm256_shuffle_ps(zx, yz, _MM_SHUFFLE(3, 1, 3, 1));  // z2 x3 y3 z3
  _mm256_store_ps(p, _mm256_permute2f128_ps(a, b, 0x20));
  _mm256_store_ps(p + 8, _mm256_permute2f128_ps(c, a, 0x30));
  _mm256_store_ps(p + 16, _mm256_permute2f128_ps(b, c, 0x31));
}
inline float lane_min(Float a) {
  __m128 m = _mm_min_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
  m = _mm_min_ps(m, _mm_movehl_ps(m, m));
  return _mm_cvtss_f32(_mm_min_ss(m, _mm_movehdup_ps(m)));
}
inline float first_lane(Float a) { return _mm256_cvtss_f32(a.v); }
inline Float half_exponent(int from, Float a) {
  const __m256i half = _mm256_srli_epi32(_mm256_castps_si256(a.v), 1);
  return _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(from), half));
}

#else

constexpr int kWidth = 4;
typedef int Int4 __attribute__((vector_size(16)));

struct Mask {
  Int4 m;  // each lane is -1 or 0
};
struct Int {
  Int4 v;
};
struct Float {
  Float4 v;
  Float() = default;
  Float(Float4 x) : v(x) {}
  Float(float x) : v(Float4{x, x, x, x}) {}
};

inline Float loadu(const float* p) { return load4(p); }
inline Float load(const float* p) { return load4(p); }
inline void store(float* p, Float x) { std::memcpy(p, &x.v, sizeof x.v); }
inline void store(int* p, Int x) { std::memcpy(p, &x.v, sizeof x.v); }
inline Int load(const int* p) {
  Int4 x;
  std::memcpy(&x, p, sizeof x);
  return {x};
}
inline Int int_of(int x) { return {Int4{x, x, x, x}}; }
inline Float operator+(Float a, Float b) { return a.v + b.v; }
inline Float operator-(Float a, Float b) { return a.v - b.v; }
inline Float operator*(Float a, Float b) { return a.v * b.v; }
inline Float operator/(Float a, Float b) { return a.v / b.v; }
inline Float operator-(Float a) { return -a.v; }
inline Float fma(Float a, Float b, Float c) { return a.v * b.v + c.v; }
inline Float min(Float a, Float b) { return a.v < b.v ? a.v : b.v; }
inline Float max(Float a, Float b) { return a.v > b.v ? a.v : b.v; }
inline Float sqrt(Float a) {
  return Float4{std::sqrt(a.v[0]), std::sqrt(a.v[1]), std::sqrt(a.v[2]), std::sqrt(a.v[3])};
}
inline Float abs(Float a) {
  return reinterpret_cast<Float4>(reinterpret_cast<Int4>(a.v) & 0x7fffffff);
}
inline Mask operator<(Float a, Float b) { return {a.v < b.v}; }
inline Mask operator<=(Float a, Float b) { return {a.v <= b.v}; }
inline Mask operator&(Mask a, Mask b) { return {a.m & b.m}; }
inline Mask operator|(Mask a, Mask b) { return {a.m | b.m}; }
inline Mask operator~(Mask a) { return {~a.m}; }
inline std::uint32_t bits(Mask a) {
  return static_cast<std::uint32_t>((a.m[0] & 1) | (a.m[1] & 2) | (a.m[2] & 4) | (a.m[3] & 8));
}
inline Mask mask_of(std::uint32_t b) {
  const int x = static_cast<int>(b);
  return {Int4{-(x & 1), -(x >> 1 & 1), -(x >> 2 & 1), -(x >> 3 & 1)}};
}
inline Float select(Mask m, Float a, Float b) { return m.m ? a.v : b.v; }
inline Int select(Mask m, Int a, Int b) { return {m.m ? a.v : b.v}; }
inline Mask less(Int a, Int b) { return {a.v < b.v}; }
inline Mask operator==(Int a, Int b) { return {a.v == b.v}; }
inline Int operator+(Int a, Int b) { return {a.v + b.v}; }
inline Int operator*(Int a, Int b) { return {a.v * b.v}; }
inline Int truncate(Float a) { return {__builtin_convertvector(a.v, Int4)}; }
inline Float to_float(Int a) { return __builtin_convertvector(a.v, Float4); }
inline Float floor(Float a) {
  return Float4{std::floor(a.v[0]), std::floor(a.v[1]), std::floor(a.v[2]), std::floor(a.v[3])};
}
inline Float gather(const float* p, Int i) {
  return Float4{p[i.v[0]], p[i.v[1]], p[i.v[2]], p[i.v[3]]};
}
inline Int gather(const int* p, Int i) {
  return {Int4{p[i.v[0]], p[i.v[1]], p[i.v[2]], p[i.v[3]]}};
}
inline void gather_pairs(const std::uint32_t* p, Int i, Int& first, Int& second) {
  for (int k = 0; k < kWidth; ++k) {
    first.v[k] = static_cast<int>(p[i.v[k]]);
    second.v[k] = static_cast<int>(p[i.v[k] + 1]);
  }
}
inline Float rounded(Float a) {
#if defined(__aarch64__)
  __asm__("" : "+w"(a.v));
#else
  __asm__("" : "+m"(a.v));
#endif
  return a;
}
inline Float shifted(double by, Float a) {
  for (int k = 0; k < kWidth; ++k) a.v[k] = static_cast<float>(by + static_cast<double>(a.v[k]));
  return a;
}
inline void store_rows(float* p, Float x, Float y, Float z) {
  for (int k = 0; k < kWidth; ++k) {
    p[3 * k] = x.v[k];
    p[3 * k + 1] = y.v[k];
    p[3 * k + 2] = z.v[k];
  }
}
inline float lane_min(Float a) {
  const float x = a.v[0] < a.v[1] ? a.v[0] : a.v[1], y = a.v[2] < a.v[3] ? a.v[2] : a.v[3];
  return x < y ? x : y;
}
inline float first_lane(Float a) { return a.v[0]; }
inline Float half_exponent(int from, Float a) {
  return reinterpret_cast<Float4>(from - (reinterpret_cast<Int4>(a.v) >> 1));
}

#endif

inline bool any(Mask m) { return bits(m) != 0; }
inline Mask operator>(Float a, Float b) { return b < a; }
inline Mask operator>=(Float a, Float b) { return b <= a; }
inline float lane_max(Float m) { return -lane_min(-m); }
// 1 / sqrt(a) of positive numbers with a relative error below 5e-6, the same on all instruction sets: two of
// Newton's steps from a first value (C. Lomont, Fast inverse square root, 2003). Measured: 0.10 ns a number
// with AVX-512, where the square root and the division take 0.41 ns, and 0.14 instead of 0.38 ns with AVX2.
inline Float inverse_sqrt(Float a) {
  const Float half = a * Float(0.5f);
  Float y = half_exponent(0x5f375a86, a);
  for (int step = 0; step < 2; ++step) y = y * fma(-half * y, y, Float(1.5f));
  return y;
}
constexpr std::uint32_t kAllLanes = (1u << kWidth) - 1;

struct Vec3f {
  Float x, y, z;
};

struct Vec4f {
  Float x, y, z, w;
};
// Transposes: lane i of (x, y, z, w) is rows[i].
inline Vec4f columns(const Float4* rows) {
#if defined(__AVX512F__) || defined(__AVX2__)
#if defined(__AVX512F__)
  using Vector = __m512;
  const auto row = [&](int i) {
    Vector r = _mm512_castps128_ps512(rows[i]);
    r = _mm512_insertf32x4(r, rows[i + 4], 1);
    r = _mm512_insertf32x4(r, rows[i + 8], 2);
    return _mm512_insertf32x4(r, rows[i + 12], 3);
  };
  const auto low = [](Vector a, Vector b) { return _mm512_unpacklo_ps(a, b); };
  const auto high = [](Vector a, Vector b) { return _mm512_unpackhi_ps(a, b); };
  const auto first = [](Vector a, Vector b) { return _mm512_shuffle_ps(a, b, 0x44); };
  const auto last = [](Vector a, Vector b) { return _mm512_shuffle_ps(a, b, 0xee); };
#else
  using Vector = __m256;
  const auto row = [&](int i) { return _mm256_set_m128(rows[i + 4], rows[i]); };
  const auto low = [](Vector a, Vector b) { return _mm256_unpacklo_ps(a, b); };
  const auto high = [](Vector a, Vector b) { return _mm256_unpackhi_ps(a, b); };
  const auto first = [](Vector a, Vector b) { return _mm256_shuffle_ps(a, b, 0x44); };
  const auto last = [](Vector a, Vector b) { return _mm256_shuffle_ps(a, b, 0xee); };
#endif
  const Vector r0 = row(0), r1 = row(1), r2 = row(2), r3 = row(3);
  const Vector xy01 = low(r0, r1), xy23 = low(r2, r3), zw01 = high(r0, r1), zw23 = high(r2, r3);
  return {first(xy01, xy23), last(xy01, xy23), first(zw01, zw23), last(zw01, zw23)};
#else
  Vec4f out;
  for (int k = 0; k < kWidth; ++k) {
    out.x.v[k] = rows[k][0];
    out.y.v[k] = rows[k][1];
    out.z.v[k] = rows[k][2];
    out.w.v[k] = rows[k][3];
  }
  return out;
#endif
}
inline Vec3f operator+(Vec3f a, Vec3f b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3f operator-(Vec3f a, Vec3f b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Float dot(Vec3f a, Vec3f b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
inline Vec3f along(Vec3f o, Float t, Vec3f d) {
  return {fma(t, d.x, o.x), fma(t, d.y, o.y), fma(t, d.z, o.z)};
}

}  // namespace
}  // namespace mjsense
