// Bilinear samples of rectified images in 16 bit, without gathers: voxels that are neighbours in x are seen at evenly
// spaced columns, so a window of contiguous pixels holds all that a vector of voxels needs.
//
// Vertical weights have 15 bits, horizontal ones 14: a sample is exact to 3 / 32767 of the brightest pixel
// (1/2 for rounding pixels, 1 + 1/2 for the vertical, 1 for the horizontal weight).
#pragma once

#include "simd/lanes.hpp"

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

// Where the voxels of a row are seen in a view: at column start + step x.
struct Spacing {
    double start, step;
};

#if defined(__AVX512BW__)

using Window = __m512i;

struct Taps {
    int first;
    __m512i index, weight;
};

constexpr bool window_of_a_row = true;  // both vectors of voxels, where they are compact

// Spacing in fixed point: without conversions, taps take half the time.
class Columns {
public:
    Columns() = default;
    explicit Columns(const Spacing &at)
        : start_(fixed(at.start, 32)),
          step_(fixed(at.step, 32)),
          vector_step_(static_cast<int32_t>(fixed(at.step * lanes, fraction_bits))),
          compact_(at.step <= most_compact_step) {
        for (int k = 0; k < lanes; ++k) lanes_[k] = static_cast<int32_t>(fixed(at.step * k, fraction_bits));
    }
    // Whether two vectors of voxels see no more than 32 pixels, which is one window.
    bool compact() const { return compact_; }

    [[gnu::always_inline]] void taps(int x0, Taps (&taps)[parts]) const {
        for (int part = 0; part < parts; ++part) {
            const int64_t position = start_ + step_ * (compact_ ? x0 : x0 + part * lanes);
            const auto fraction = static_cast<int32_t>(static_cast<uint32_t>(position) >> (32 - fraction_bits));
            constexpr int32_t rounding = 1 << (fraction_bits - weight_bits - 1);
            const Ints at = lanes_ + (fraction + rounding + (compact_ ? part * vector_step_ : 0));
            const auto left = reinterpret_cast<Ints>(_mm512_srli_epi32(reinterpret_cast<__m512i>(at), fraction_bits));
            const Ints right_weight = at >> (fraction_bits - weight_bits) & ((1 << weight_bits) - 1);
            taps[part].first = static_cast<int>(position >> 32);
            taps[part].index = reinterpret_cast<__m512i>((left << 16) + left + (1 << 16));
            taps[part].weight = reinterpret_cast<__m512i>((right_weight << 16) - right_weight + (1 << weight_bits));
        }
    }

private:
    static constexpr int fraction_bits = 26;
    static constexpr double most_compact_step = 0.967;
    static int64_t fixed(double value, int bits) { return static_cast<int64_t>(value * static_cast<double>(int64_t{1} << bits) + 0.5); }
    int64_t start_, step_;
    int32_t vector_step_;
    Ints lanes_;
    bool compact_;
};

inline Window between(const Window &top, const Window &bottom, int32_t weight) {
    return _mm512_add_epi16(top, _mm512_mulhrs_epi16(_mm512_sub_epi16(bottom, top), _mm512_set1_epi32(weight)));
}

[[gnu::always_inline]] inline Window blend(const int16_t *above, const int16_t *below, int32_t weight) {
    return between(_mm512_loadu_si512(above), _mm512_loadu_si512(below), weight);
}

template <bool>
[[gnu::always_inline]] inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    return blend(above + taps.first, below + taps.first, weight);
}

[[gnu::always_inline]] inline Floats pick(const Window &window, const Taps &taps) {
    const __m512i pairs = _mm512_permutexvar_epi16(taps.index, window);
    return reinterpret_cast<Floats>(_mm512_cvtepi32_ps(_mm512_madd_epi16(pairs, taps.weight)));
}

#elif defined(__AVX2__)

using Window = __m256i;  // two windows of 8 pixels, for 4 voxels each

struct Taps {
    int first, second;  // of the windows; compact: the first of 16 pixels
    __m256i bytes, weight;
};

constexpr bool window_of_a_row = false;

class Columns {
public:
    Columns() = default;
    explicit Columns(const Spacing &at) : at_(at) {}
    // Whether the windows of a vector are the pixels 0 .. 7 and 4 .. 11 from the one before its first voxel on.
    bool compact() const { return at_.step >= 0.75 && at_.step <= 1.25; }

    [[gnu::always_inline]] void taps(int x0, Taps (&taps)[parts]) const {
        const Floats steps = lane_numbers() * static_cast<float>(at_.step);
        for (int part = 0; part < parts; ++part) {
            const double position = at_.start + at_.step * (x0 + part * lanes);
            const int first = static_cast<int>(position);
            const Floats at = steps + all(static_cast<float>(position - first));
            const Ints left = __builtin_convertvector(at, Ints);
            const int second = compact() ? 3 : left[4], before = compact() ? 1 : 0;
            const Ints start = {-before, -before, -before, -before, second, second, second, second};
            const Ints bytes = (left - start) * 0x02020202 + 0x03020100;
            const Ints weight = horizontal_weights(at - __builtin_convertvector(left, Floats));
            taps[part] = {first - before, first + second, reinterpret_cast<__m256i>(bytes), reinterpret_cast<__m256i>(weight)};
        }
    }

private:
    Spacing at_;
};

inline Window between(const Window &top, const Window &bottom, int32_t weight) {
    return _mm256_add_epi16(top, _mm256_mulhrs_epi16(_mm256_sub_epi16(bottom, top), _mm256_set1_epi32(weight)));
}

inline Window two_windows(const int16_t *row, const Taps &taps) {
    const auto half = [row](int at) { return _mm_loadu_si128(reinterpret_cast<const __m128i *>(row + at)); };
    return _mm256_inserti128_si256(_mm256_castsi128_si256(half(taps.first)), half(taps.second), 1);
}

template <bool compact>
[[gnu::always_inline]] inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    if constexpr (!compact) return between(two_windows(above, taps), two_windows(below, taps), weight);
    const auto window = [&taps](const int16_t *row) {
        return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(row + taps.first));
    };
    constexpr int quarters = 0x94;  // 0 and 1, then 1 and 2
    return _mm256_permute4x64_epi64(between(window(above), window(below), weight), quarters);
}

[[gnu::always_inline]] inline Floats pick(const Window &window, const Taps &taps) {
    const __m256i pairs = _mm256_shuffle_epi8(window, taps.bytes);
    return reinterpret_cast<Floats>(_mm256_cvtepi32_ps(_mm256_madd_epi16(pairs, taps.weight)));
}

#else

struct Window {
    const int16_t *above, *below;
    float weight;
};

struct Taps {
    int first;
    int32_t index[lanes];
    Floats fraction;
};

constexpr bool window_of_a_row = false;

class Columns {
public:
    Columns() = default;
    explicit Columns(const Spacing &at) : at_(at) {}
    bool compact() const { return false; }

    void taps(int x0, Taps (&taps)[parts]) const {
        const Floats steps = lane_numbers() * static_cast<float>(at_.step);
        for (int part = 0; part < parts; ++part) {
            const double position = at_.start + at_.step * (x0 + part * lanes);
            const int first = static_cast<int>(position);
            const Floats at = steps + all(static_cast<float>(position - first));
            const Ints left = __builtin_convertvector(at, Ints);
            taps[part].first = first;
            store(taps[part].index, left);
            taps[part].fraction = at - __builtin_convertvector(left, Floats);
        }
    }

private:
    Spacing at_;
};

template <bool>
[[gnu::always_inline]] inline Window blend(const int16_t *above, const int16_t *below, int32_t weight, const Taps &taps) {
    return {above + taps.first, below + taps.first, static_cast<float>(weight & 0xffff) * (1.0f / 32768)};
}

// Neighbours in x are the halves of one word.
[[gnu::always_inline]] inline Floats pick(const Window &window, const Taps &taps) {
    Ints top, bottom;
    for (int k = 0; k < lanes; ++k) {
        top[k] = load<int32_t>(window.above + taps.index[k]);
        bottom[k] = load<int32_t>(window.below + taps.index[k]);
    }
    const auto between = [&window](Ints above, Ints below) {
        const Floats start = __builtin_convertvector(above, Floats);
        return start + (__builtin_convertvector(below, Floats) - start) * window.weight;
    };
    const Floats left = between(top << 16 >> 16, bottom << 16 >> 16), right = between(top >> 16, bottom >> 16);
    return (left + (right - left) * taps.fraction) * (1.0f / sample_unit);
}

#endif

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
