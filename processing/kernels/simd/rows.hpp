// Rows of voxels on their way into projections, and what evenly spaced pixels see of them by linear interpolation.
#pragma once

#include "simd/voxels.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Positions of a vector of pixels on a row of floats, less than two vectors from first to last, by permutation.
struct Picked {
    Ints left;
    Floats fraction;
    Picked() = default;
    explicit Picked(Floats at)
        : left(__builtin_convertvector(at, Ints)), fraction(at - __builtin_convertvector(left, Floats)) {}
    [[gnu::always_inline]] Floats of(const float *window) const {
        Floats near, far;
#if defined(__AVX2__)
        const Floats low = load<Floats>(window), high = load<Floats>(window + lanes);
        near = __builtin_shuffle(low, high, left);
        far = __builtin_shuffle(low, high, left + 1);
#else
        for (int k = 0; k < lanes; ++k) {
            near[k] = window[left[k]];
            far[k] = window[left[k] + 1];
        }
#endif
        return near + fraction * (far - near);
    }
};

// The same where pixels are nearly as dense as voxels, so that pixel k lies between the voxels k and k + 2 of the
// window: each of three neighbours adds with the weight 1 - |distance|.
struct Weighted {
    Floats weights[3];
    static bool fits(double step) { return step >= 1.0 && (lanes - 1) * (step - 1.0) < 0.999; }
    Weighted() = default;
    explicit Weighted(Floats at) {
        const Floats one = all(1.0f), zero{}, beyond = at - lane_numbers();
        const Floats inner = beyond < one ? one - beyond : zero, outer = beyond > one ? beyond - one : zero;
        weights[0] = inner;
        weights[1] = one - inner - outer;
        weights[2] = outer;
    }
    [[gnu::always_inline]] Floats of(const float *window) const {
        const Floats near = weights[0] * load<Floats>(window);
        return multiply_add(weights[2], load<Floats>(window + 2), multiply_add(weights[1], load<Floats>(window + 1), near));
    }
};

#if defined(__AVX512BW__)

// A window of 32 voxels in 16 bit is one load, and each neighbour one permutation.
typedef Voxel RowVoxel;

[[gnu::always_inline]] inline void store_row(RowVoxel *to, const Floats (&)[parts], const RowWords &words) { words.store(to); }

inline float row_value(RowVoxel voxel) { return voxel_value(voxel); }

struct RowSamples {
    __m512i left, right;
    Floats fraction;
    static constexpr bool fits(double) { return true; }
    RowSamples() = default;
    explicit RowSamples(Floats at) {
        const Ints near = __builtin_convertvector(at, Ints);
        fraction = at - __builtin_convertvector(near, Floats);
        left = reinterpret_cast<__m512i>(near << 16);
        right = reinterpret_cast<__m512i>((near + 1) << 16);
    }
    [[gnu::always_inline]] Floats of(const RowVoxel *window) const {
        constexpr __mmask32 upper = 0xaaaaaaaa;
        __m512i words = _mm512_loadu_si512(window);
        __asm__("" : "+v"(words));  // or compilers read it twice
        const Floats near = values(_mm512_maskz_permutexvar_epi16(upper, left, words));
        const Floats far = values(_mm512_maskz_permutexvar_epi16(upper, right, words));
        return near + fraction * (far - near);
    }
    // Of voxels in upper halves.
    static Floats values(__m512i words) { return reinterpret_cast<Floats>(_mm512_srli_epi32(words, 16 - dropped_bits)); }
};
typedef RowSamples QuickRowSamples;

#else

typedef float RowVoxel;

[[gnu::always_inline]] inline void store_row(RowVoxel *to, const Floats (&values)[parts], const RowWords &) {
#pragma GCC unroll 8
    for (int part = 0; part < parts; ++part) store(to + part * lanes, values[part]);
}

inline float row_value(RowVoxel voxel) { return voxel; }

typedef Picked RowSamples;
typedef Weighted QuickRowSamples;

#endif

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
