// Vectors of the width that the instruction set offers, and the operations that compilers need help with.
#pragma once

#include <cstdint>
#include <cstring>
#if defined(__F16C__)
#include <immintrin.h>
#endif

#include "job.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

#if defined(__AVX512F__)
constexpr int lanes = 16;
#elif defined(__AVX2__)
constexpr int lanes = 8;
#else
constexpr int lanes = 4;
#endif

constexpr int parts = block_columns / lanes;  // vectors in a row of a block

typedef float Floats __attribute__((vector_size(4 * lanes)));
typedef int32_t Ints __attribute__((vector_size(4 * lanes)));

template <class Vector, class Scalar>
inline Vector load(const Scalar *from) {
    Vector vector;
    std::memcpy(&vector, from, sizeof vector);
    return vector;
}

template <class Vector, class Scalar>
inline void store(Scalar *to, Vector vector) {
    std::memcpy(to, &vector, sizeof vector);
}

// In all lanes. Compilers leave out the subtraction of zero, but not its addition, which makes zero of minus zero.
inline Floats all(float value) { return value - Floats{}; }

template <class To, class From>
inline To same_bits(From from) {
    To to;
    static_assert(sizeof to == sizeof from, "values of one size");
    std::memcpy(&to, &from, sizeof to);
    return to;
}

inline int smaller(int a, int b) { return a < b ? a : b; }
inline int larger(int a, int b) { return a > b ? a : b; }
inline int floor_of(double x) { return static_cast<int>(x) - (static_cast<int>(x) > x); }
inline int ceil_of(double x) { return -floor_of(-x); }

inline Floats lane_numbers() {
    Floats lane;
    for (int k = 0; k < lanes; ++k) lane[k] = static_cast<float>(k);
    return lane;
}

// a b + c, rounded once wherever the instruction set can: the same bits in every kernel, however compilers arrange it.
inline Floats multiply_add(Floats a, Floats b, Floats c) {
#if defined(__AVX512F__)
    return reinterpret_cast<Floats>(
        _mm512_fmadd_ps(reinterpret_cast<__m512>(a), reinterpret_cast<__m512>(b), reinterpret_cast<__m512>(c)));
#elif defined(__FMA__)
    return reinterpret_cast<Floats>(
        _mm256_fmadd_ps(reinterpret_cast<__m256>(a), reinterpret_cast<__m256>(b), reinterpret_cast<__m256>(c)));
#elif defined(__FP_FAST_FMAF)
    for (int k = 0; k < lanes; ++k) c[k] = __builtin_fmaf(a[k], b[k], c[k]);
    return c;
#else
    return a * b + c;
#endif
}

// The lesser of a and b, b where one of them is not a number. Compilers do not find the instruction.
inline Floats lesser(Floats a, Floats b) {
#if defined(__AVX512F__)
    return reinterpret_cast<Floats>(_mm512_min_ps(reinterpret_cast<__m512>(a), reinterpret_cast<__m512>(b)));
#elif defined(__AVX2__)
    return reinterpret_cast<Floats>(_mm256_min_ps(reinterpret_cast<__m256>(a), reinterpret_cast<__m256>(b)));
#else
    return a < b ? a : b;
#endif
}

inline Floats square_root(Floats x) {
#if defined(__AVX512F__)
    return reinterpret_cast<Floats>(_mm512_sqrt_ps(reinterpret_cast<__m512>(x)));
#elif defined(__AVX2__)
    return reinterpret_cast<Floats>(_mm256_sqrt_ps(reinterpret_cast<__m256>(x)));
#else
    for (int k = 0; k < lanes; ++k) x[k] = __builtin_sqrtf(x[k]);
    return x;
#endif
}

inline double sum_of(Floats values) {
    double sum = 0;
    for (int k = 0; k < lanes; ++k) sum += values[k];
    return sum;
}

// What lies at places in a table, and what follows. Gathering by one instruction is slower on processors of AVX2.
inline void look_up(const float *table, Ints at, Floats &one, Floats &next) {
#if defined(__AVX512F__)
    one = reinterpret_cast<Floats>(_mm512_i32gather_ps(reinterpret_cast<__m512i>(at), table, 4));
    next = reinterpret_cast<Floats>(_mm512_i32gather_ps(reinterpret_cast<__m512i>(at), table + 1, 4));
#elif defined(__AVX2__)
    int place[lanes];
    store(place, at);
    const auto pairs = [&](int first, int second) {
        const auto *low = reinterpret_cast<const __m64 *>(table + place[first]);
        const auto *high = reinterpret_cast<const __m64 *>(table + place[second]);
        return _mm_loadh_pi(_mm_loadl_pi(_mm_setzero_ps(), low), high);
    };
    const __m256 front = _mm256_set_m128(pairs(4, 5), pairs(0, 1)), back = _mm256_set_m128(pairs(6, 7), pairs(2, 3));
    one = reinterpret_cast<Floats>(_mm256_shuffle_ps(front, back, 0x88));
    next = reinterpret_cast<Floats>(_mm256_shuffle_ps(front, back, 0xdd));
#else
    for (int k = 0; k < lanes; ++k) {
        one[k] = table[at[k]];
        next[k] = table[at[k] + 1];
    }
#endif
}

// Two neighbouring pixels, by weights in the halves of a word: one word of pixels is all that is read.
inline Floats weighted_pairs(const int16_t *pixels, Ints at, Ints weight) {
#if defined(__AVX512BW__)
    const __m512i pairs = _mm512_i32gather_epi32(reinterpret_cast<__m512i>(at), pixels, 2);
    return reinterpret_cast<Floats>(_mm512_cvtepi32_ps(_mm512_madd_epi16(pairs, reinterpret_cast<__m512i>(weight))));
#elif defined(__AVX2__)
    const __m256i pairs =
        _mm256_i32gather_epi32(reinterpret_cast<const int *>(pixels), reinterpret_cast<__m256i>(at), 2);
    return reinterpret_cast<Floats>(_mm256_cvtepi32_ps(_mm256_madd_epi16(pairs, reinterpret_cast<__m256i>(weight))));
#else
    Ints sum;
    for (int k = 0; k < lanes; ++k)
        sum[k] = pixels[at[k]] * static_cast<int16_t>(weight[k]) + pixels[at[k] + 1] * (weight[k] >> 16);
    return __builtin_convertvector(sum, Floats);
#endif
}

#if defined(__ARM_FP16_FORMAT_IEEE)
typedef __fp16 Half;  // compilers of Debian 12 know no other name in C++
#else
typedef _Float16 Half;
#endif

inline uint16_t half_of(float value) {
    const Half half = static_cast<Half>(value);
    uint16_t bits;
    std::memcpy(&bits, &half, sizeof bits);
    return bits;
}

inline void store_halves(uint16_t *to, const float *from, int count) {
    int k = 0;
#if defined(__AVX512F__)
    for (; k + 16 <= count; k += 16)
        _mm256_storeu_si256(reinterpret_cast<__m256i *>(to + k),
                            _mm512_cvtps_ph(_mm512_loadu_ps(from + k), _MM_FROUND_TO_NEAREST_INT));
#endif
#if defined(__F16C__)
    for (; k + 8 <= count; k += 8)
        _mm_storeu_si128(reinterpret_cast<__m128i *>(to + k),
                         _mm256_cvtps_ph(_mm256_loadu_ps(from + k), _MM_FROUND_TO_NEAREST_INT));
#endif
    for (; k < count; ++k) to[k] = half_of(from[k]);
}

// Voxels that decay under SMART would end as subnormal numbers, a hundred times slower than others.
class FlushSubnormals {
public:
#if defined(__SSE2__)
    FlushSubnormals() : before_(__builtin_ia32_stmxcsr()) { __builtin_ia32_ldmxcsr(before_ | 0x8040); }
    ~FlushSubnormals() { __builtin_ia32_ldmxcsr(before_); }
    FlushSubnormals(const FlushSubnormals &) = delete;
    FlushSubnormals &operator=(const FlushSubnormals &) = delete;

private:
    unsigned before_;
#else
    FlushSubnormals() {}
#endif
};

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
