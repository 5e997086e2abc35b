// From projections to the ratio images that correct the volume.
#pragma once

#include "lanes.hpp"
#include "job.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr float nothing = 1e-7f;  // projected intensity below which a pixel sees nothing

typedef int16_t Shorts __attribute__((vector_size(2 * lanes)));

template <class To, class From>
inline To same_bits(From from) {
    To to;
    static_assert(sizeof to == sizeof from, "vectors of one size");
    std::memcpy(&to, &from, sizeof to);
    return to;
}

// By the series of artanh, for positive normal numbers; exact to 4e-8, or to the rounding of the result.
inline Floats logarithm_2(Floats x) {
    constexpr int32_t root_of_half = 0x3f3504f3;
    const Ints bits = same_bits<Ints>(x), exponent = (bits - root_of_half) >> 23;
    const Floats mantissa = same_bits<Floats>(bits - (exponent << 23)), t = (mantissa - 1.0f) / (mantissa + 1.0f), s = t * t;
    constexpr float two_over_ln2 = 2.88539008f;
    return __builtin_convertvector(exponent, Floats) +
           two_over_ln2 * t * (1.0f + s * (1.0f / 3 + s * (1.0f / 5 + s * (1.0f / 7 + s * (1.0f / 9)))));
}

// By the series of the exponential function, exact to 2e-7.
inline Floats power_of_2(Floats x) {
    const Floats zero{}, least = zero - 126.0f, most = zero + 126.0f;
    x = x > least ? x : least;
    x = x < most ? x : most;
    const Ints whole = __builtin_convertvector(x + 512.5f, Ints) - 512;
    const Floats f = (x - __builtin_convertvector(whole, Floats)) * 0.693147181f;
    const Floats series =
        1.0f + f * (1.0f + f * (1.0f / 2 + f * (1.0f / 6 + f * (1.0f / 24 + f * (1.0f / 120 + f * (1.0f / 720))))));
    return same_bits<Floats>(same_bits<Ints>(series) + (whole << 23));
}

// Zero stays zero.
inline Floats power(Floats x, float exponent) {
    const Floats zero{}, least = zero + 1e-36f;
    return x > least ? power_of_2(exponent * logarithm_2(x > least ? x : least)) : zero;
}

inline Floats sum_of_parts(const Correction &job, int row, int column) {
    Floats sum{};
    for (int i = 0; i < job.n_parts; ++i) {
        const Projection &part = job.parts[i];
        if (row < part.first_row || row >= part.first_row + part.rows) continue;
        sum += load<Floats>(part.pixels + (row - part.first_row) * part.stride + column);
    }
    return sum * job.unit;
}

double correct(const Correction &job, int row) {
    const FlushSubnormals flush;
    const Floats zero{}, floor = zero + nothing, most = zero + 32767.0f;
    Floats missed{};
    for (int column = 0; column < job.columns; column += lanes) {
        const int64_t at = static_cast<int64_t>(row) * job.columns + column;
        const size_t bytes = sizeof(int16_t) * static_cast<size_t>(smaller(lanes, job.columns - column));
        Shorts counts{};
        std::memcpy(&counts, job.recorded + at, bytes);
        const Floats recorded = __builtin_convertvector(__builtin_convertvector(counts, Ints), Floats) * job.recorded_unit;
        const Floats projected = sum_of_parts(job, row, column), difference = projected - recorded;
        missed += difference * difference;
        const Floats ratio = recorded / (projected > floor ? projected : floor);
        Floats scaled = power(ratio, job.exponent) * job.ratio_counts + 0.5f;
        scaled = scaled < most ? scaled : most;
        const Ints seen = projected > floor;
        counts = __builtin_convertvector(__builtin_convertvector(scaled, Ints) & seen, Shorts);
        std::memcpy(job.ratio + at, &counts, bytes);
    }
    double sum = 0;
    for (int k = 0; k < lanes; ++k) sum += missed[k];
    return sum;
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
