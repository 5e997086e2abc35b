// From projections to the ratio images that correct the volume.
#pragma once

#include "simd/lanes.hpp"
#include "job.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr float nothing = 1e-7f;  // projected intensity below which a pixel sees nothing; of images as bright as 1/2 to 1

typedef int16_t Shorts __attribute__((vector_size(2 * lanes)));

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

// The path of each line of sight of a row.
class RowOfPaths {
public:
    RowOfPaths(const Path &path, int row) : path_(path) {
        const float across = (static_cast<float>(row) - path.foot_v) * path.per_distance;
        across_ = all(1.0f + across * across);
    }
    Floats from(int column) const {
        const Floats along = (lane_numbers() + all(static_cast<float>(column) - path_.foot_u)) * path_.per_distance;
        return square_root(multiply_add(along, along, across_));
    }

private:
    Path path_;
    Floats across_;
};

// What the bands of the volume add to a row of an image.
class RowOfParts {
public:
    RowOfParts(const Correction &job, int row) : unit_(job.unit), paths_(job.path, row) {
        for (int i = 0; i < job.n_parts; ++i) {
            const Projection &part = job.parts[i];
            if (row >= part.first_row && row < part.first_row + part.rows)
                rows_[count_++] = part.pixels + (row - part.first_row) * part.stride;
        }
    }
    Floats sum(int column) const {
        Floats sum{};
        for (int i = 0; i < count_; ++i) sum += load<Floats>(rows_[i] + column);
        return sum * unit_ * paths_.from(column);
    }

private:
    float unit_;
    RowOfPaths paths_;
    int count_ = 0;
    const float *rows_[max_bands];
};

inline bool all_zero(const Shorts &counts) {
    uint64_t words[sizeof counts / sizeof(uint64_t)], any = 0;
    std::memcpy(words, &counts, sizeof counts);
    for (uint64_t word : words) any |= word;
    return !any;
}

// Ratios in counts, of the exponent's power: 1 where nothing is to be corrected, because the projection is what was recorded,
// as far as that is known, which is to half a count; or because no voxel is seen in a pixel that it could be corrected by.
inline Shorts ratio_counts(const Correction &job, const Shorts &counts, Floats recorded, Floats projected) {
    const Floats floor = all(nothing), most = all(32767.0f), half = all(0.5f * job.recorded_unit);
    const Ints wrong = (projected > floor) & ((projected - recorded > half) | (recorded - projected > half));
    const Ints one = Ints{} + static_cast<int32_t>(job.ratio_counts);
    Ints ratios{};
    if (!all_zero(counts)) {
        const Floats ratio = recorded / (projected > floor ? projected : floor);
        const Floats scaled = power(ratio, job.exponent) * job.ratio_counts + 0.5f;
        ratios = __builtin_convertvector(lesser(scaled, most), Ints);
    }
    return __builtin_convertvector((ratios & wrong) | (one & ~wrong), Shorts);
}

double correct(const Correction &job, int row) {
    const FlushSubnormals flush;
    const RowOfParts parts(job, row);
    const int16_t *recorded = job.recorded + static_cast<int64_t>(row) * job.columns;
    int16_t *ratio = job.ratio + static_cast<int64_t>(row) * job.columns;
    Floats missed{};
    const auto correct_vector = [&](const int16_t *from, int16_t *to, int column) {
        const Shorts counts = load<Shorts>(from);
        const Floats seen = __builtin_convertvector(__builtin_convertvector(counts, Ints), Floats) * job.recorded_unit;
        const Floats projected = parts.sum(column), difference = projected - seen;
        missed += difference * difference;
        store(to, ratio_counts(job, counts, seen, projected));
    };
    int column = 0;
    for (; column + lanes <= job.columns; column += lanes) correct_vector(recorded + column, ratio + column, column);
    if (column < job.columns) {
        const size_t bytes = sizeof(int16_t) * static_cast<size_t>(job.columns - column);
        int16_t last[lanes] = {};
        std::memcpy(last, recorded + column, bytes);
        correct_vector(last, last, column);
        std::memcpy(ratio + column, last, bytes);
    }
    double sum = 0;
    for (int k = 0; k < lanes; ++k) sum += missed[k];
    return sum;
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
