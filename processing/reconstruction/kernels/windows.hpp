// Bilinear samples of rectified images in 16 bit, without gathers: voxels that are neighbours in x are seen at evenly
// spaced columns, so a window of contiguous pixels holds all that a vector of voxels needs.
//
// Vertical weights have 15 bits, horizontal ones 14: a sample is exact to 3 / 32767 of the brightest pixel
// (1/2 for rounding pixels, 1 + 1/2 for the vertical, 1 for the horizontal weight).
#pragma once

#include "lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int weight_bits = 14;
constexpr float sample_unit = 1.0f / (1 << weight_bits);  // of a pixel, in the results of pick()

// The lower row's share, 0 .. 32767, twice in one word: vectors of it are cheaper to make.
inline int32_t vertical_weight(float fraction) {
    const int32_t weight = smaller(static_cast<int>(fraction * 32768.0f + 0.5f), 32767);
    return weight | weight << 16;
}

inline Ints horizontal_weights(Floats fraction) {
    const Floats zero{}, rounding = zero + 0.5f;
    const Ints right = __builtin_convertvector(multiply_add(fraction, zero + static_cast<float>(1 << weight_bits), rounding), Ints);
    return right << 16 | ((1 << weight_bits) - right);
}

#if defined(__AVX512BW__)
constexpr double max_shared_scale = 0.967;  // two vectors of voxels then see no more than 32 pixels, which is one window
#else
constexpr double max_shared_scale = 0.0;
#endif
constexpr bool may_share_window = max_shared_scale > 0.0;

#if defined(__AVX512BW__)

using Window = __m512i;

struct Taps {
    int first;
    __m512i index, weight;
};

// Taps of `lanes` voxels seen from `position` on, in the window that starts at column `first`.
inline Taps taps_from(int first, double position, double scale) {
    const Floats zero{};
    const Floats at = multiply_add(lane_numbers(), zero + static_cast<float>(scale), zero + static_cast<float>(position - first));
    const Ints left = __builtin_convertvector(at, Ints);
    const Ints weight = horizontal_weights(at - __builtin_convertvector(left, Floats));
    return {first, reinterpret_cast<__m512i>(left | (left + 1) << 16), reinterpret_cast<__m512i>(weight)};
}

inline Window between(const Window &top, const Window &bottom, int32_t weight) {
    return _mm512_add_epi16(top, _mm512_mulhrs_epi16(_mm512_sub_epi16(bottom, top), _mm512_set1_epi32(weight)));
}

inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    return between(_mm512_loadu_si512(above + taps.first), _mm512_loadu_si512(below + taps.first), weight);
}

inline Floats pick(const Window &window, const Taps &taps) {
    const __m512i pairs = _mm512_permutexvar_epi16(taps.index, window);
    return reinterpret_cast<Floats>(_mm512_cvtepi32_ps(_mm512_madd_epi16(pairs, taps.weight)));
}

#elif defined(__AVX2__)

using Window = __m256i;  // two windows of 8 pixels, for 4 voxels each
struct Taps {
    int first, second;
    __m256i bytes, weight;
};

inline Taps taps_from(int first, double position, double scale) {
    const Floats zero{};
    const Floats at = multiply_add(lane_numbers(), zero + static_cast<float>(scale), zero + static_cast<float>(position - first));
    const Ints left = __builtin_convertvector(at, Ints);
    const Ints start = {left[0], left[0], left[0], left[0], left[4], left[4], left[4], left[4]};
    const Ints bytes = (left - start) * 0x02020202 + 0x03020100;
    const Ints weight = horizontal_weights(at - __builtin_convertvector(left, Floats));
    return {first + left[0], first + left[4], reinterpret_cast<__m256i>(bytes), reinterpret_cast<__m256i>(weight)};
}

inline Window two_windows(const int16_t *row, const Taps &taps) {
    const auto half = [row](int at) { return _mm_loadu_si128(reinterpret_cast<const __m128i *>(row + at)); };
    return _mm256_inserti128_si256(_mm256_castsi128_si256(half(taps.first)), half(taps.second), 1);
}

inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    const __m256i top = two_windows(above, taps), bottom = two_windows(below, taps);
    return _mm256_add_epi16(top, _mm256_mulhrs_epi16(_mm256_sub_epi16(bottom, top), _mm256_set1_epi32(weight)));
}

inline Floats pick(const Window &window, const Taps &taps) {
    const __m256i pairs = _mm256_shuffle_epi8(window, taps.bytes);
    return reinterpret_cast<Floats>(_mm256_cvtepi32_ps(_mm256_madd_epi16(pairs, taps.weight)));
}

#else

struct Window {
    const int16_t *above, *below;
    int32_t weight;
};

struct Taps {
    int first;
    Ints index, weight;
};

inline Taps taps_from(int first, double position, double scale) {
    const Floats zero{};
    const Floats at = multiply_add(lane_numbers(), zero + static_cast<float>(scale), zero + static_cast<float>(position - first));
    const Ints left = __builtin_convertvector(at, Ints);
    return {first, left, horizontal_weights(at - __builtin_convertvector(left, Floats)) >> 16};
}

inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    return {above + taps.first, below + taps.first, weight & 0xffff};
}

inline Floats pick(const Window &window, const Taps &taps) {
    Ints left, right;
    for (int k = 0; k < lanes; ++k) {
        const int16_t *above = window.above + taps.index[k], *below = window.below + taps.index[k];
        left[k] = above[0] + (((below[0] - above[0]) * window.weight + 0x4000) >> 15);
        right[k] = above[1] + (((below[1] - above[1]) * window.weight + 0x4000) >> 15);
    }
    const Ints sum = left * ((1 << weight_bits) - taps.weight) + right * taps.weight;
    return __builtin_convertvector(sum, Floats);
}

#endif

inline Taps taps_at(double position, double scale) { return taps_from(static_cast<int>(position), position, scale); }

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
