// Voxels of SMART in memory: 16 bit without a sign, 6 of exponent and the 10 of mantissa that float16 has, so that a
// voxel can grow and fade by many powers of two. In the bits of a float from 13 on they are `voxel_unit` times a voxel,
// and all arithmetic is done in that unit: what would underflow there is zero in memory, too.
#pragma once

#include "simd/lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

typedef uint16_t Voxel;
constexpr int dropped_bits = 13;
constexpr float voxel_unit = 0x1p-81f, largest_voxel = voxel_unit * 0x1.ff8p17f;

inline Floats limited(Floats values) { return lesser(values, all(largest_voxel)); }

inline float voxel_value(Voxel voxel) { return same_bits<float>(static_cast<int32_t>(voxel) << dropped_bits); }

#if defined(__AVX512BW__)

inline Floats load_voxels(const Voxel *from) {
    const __m512i words = _mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i *>(from)));
    return reinterpret_cast<Floats>(_mm512_slli_epi32(words, dropped_bits));
}

// One row of a block, rounded.
struct RowWords {
    __m512i words;
    [[gnu::always_inline]] explicit RowWords(const Floats (&values)[parts]) {
        alignas(64) static constexpr uint16_t upper_halves[32] = {1,  3,  5,  7,  9,  11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31,
                                                                  33, 35, 37, 39, 41, 43, 45, 47, 49, 51, 53, 55, 57, 59, 61, 63};
        const Ints near = (same_bits<Ints>(values[0]) + (1 << (dropped_bits - 1))) << (16 - dropped_bits);
        const Ints far = (same_bits<Ints>(values[1]) + (1 << (dropped_bits - 1))) << (16 - dropped_bits);
        words = _mm512_permutex2var_epi16(reinterpret_cast<__m512i>(near), _mm512_load_si512(upper_halves),
                                          reinterpret_cast<__m512i>(far));
    }
    [[gnu::always_inline]] void store(Voxel *to) const { _mm512_storeu_si512(to, words); }
};

#else

typedef Voxel Voxels __attribute__((vector_size(2 * lanes)));
typedef Voxel TwoVoxels __attribute__((vector_size(4 * lanes)));

inline Floats load_voxels(const Voxel *from) {
    return same_bits<Floats>(__builtin_convertvector(load<Voxels>(from), Ints) << dropped_bits);
}

struct RowWords {
    TwoVoxels words[parts / 2];
    [[gnu::always_inline]] explicit RowWords(const Floats (&values)[parts]) {
#pragma GCC unroll 4
        for (int n = 0; n < parts / 2; ++n) words[n] = packed(rounded(values[2 * n]), rounded(values[2 * n + 1]));
    }
    [[gnu::always_inline]] void store(Voxel *to) const {
#pragma GCC unroll 4
        for (int n = 0; n < parts / 2; ++n) tomoshadow::TOMOSHADOW_ISA::store(to + 2 * n * lanes, words[n]);
    }

private:
    static Ints rounded(Floats values) { return (same_bits<Ints>(values) + (1 << (dropped_bits - 1))) >> dropped_bits; }
    static TwoVoxels packed(Ints near, Ints far) {
#if defined(__AVX2__)
        const __m256i halves = _mm256_packus_epi32(reinterpret_cast<__m256i>(near), reinterpret_cast<__m256i>(far));
        return reinterpret_cast<TwoVoxels>(_mm256_permute4x64_epi64(halves, 0xd8));
#else
        const Voxels both[2] = {__builtin_convertvector(near, Voxels), __builtin_convertvector(far, Voxels)};
        return load<TwoVoxels>(both);
#endif
    }
};

#endif

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
