// A recorded image resampled by cubic convolution (Keys 1981), at positions that are linear between nodes.
#pragma once

#include "job.hpp"
#include "simd/lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int spacing = Resampling::node_spacing;
constexpr float keys = -0.6f;  // slope of the kernel at distance 1

// Weights of the four pixels around a position with this fraction; they add up to one.
template <class Value>
struct CubicWeights {
    Value w[4];
    explicit CubicWeights(Value f) {
        const Value g = 1.0f - f, fg = keys * f * g;
        w[0] = fg * g;
        w[1] = ((keys + 2) * f - (keys + 3)) * (f * f) + 1.0f;
        w[3] = fg * f;
        w[2] = 1.0f - w[0] - w[1] - w[3];
    }
};

inline int16_t rounded(float value) {
    value = value > 0.0f ? value : 0.0f;
    return static_cast<int16_t>((value < 32767.0f ? value : 32767.0f) + 0.5f);
}

// Positions (u, v) of `spacing` pixels of the resampled image, in the recorded one with its margins.
struct Segment {
    float u, v, step_u, step_v;

    Segment(const Resampling &job, int row, int column) {
        const int from = row / spacing;
        const float along = static_cast<float>(row % spacing) / spacing;
        const float *upper = job.nodes + 2 * (static_cast<int64_t>(from) * job.nodes_x + column / spacing);
        const float *lower = upper + 2 * job.nodes_x;
        const auto node = [&](int k) { return upper[k] + along * (lower[k] - upper[k]); };
        u = node(0) + job.origin_u;
        v = node(1) + job.origin_v;
        step_u = (node(2) - node(0)) / spacing;
        step_v = (node(3) - node(1)) / spacing;
    }
    float last_u() const { return u + step_u * (spacing - 1); }
    float last_v() const { return v + step_v * (spacing - 1); }
};

inline float lesser(float a, float b) { return a < b ? a : b; }
inline float greater(float a, float b) { return a > b ? a : b; }

// A box of pixels around all that a segment needs, one more on each side of the four.
struct Box {
    int left, right, top, bottom;
    bool inside;

    Box(const Resampling &job, const Segment &at) {
        const float u0 = lesser(at.u, at.last_u()), u1 = greater(at.u, at.last_u());
        const float v0 = lesser(at.v, at.last_v()), v1 = greater(at.v, at.last_v());
        // also false for positions that are not numbers
        inside = u0 >= 2 && v0 >= 2 && u1 < static_cast<float>(job.from_columns - 34) &&
                 v1 < static_cast<float>(job.from_rows - 4);
        left = inside ? static_cast<int>(u0) - 1 : 0;
        right = inside ? static_cast<int>(u1) + 3 : 0;
        top = inside ? static_cast<int>(v0) - 1 : 0;
        bottom = inside ? static_cast<int>(v1) + 3 : 0;
    }
    // Whether all positions lie between the same two rows.
    bool one_row() const { return bottom - top == 4; }
};

// Most boxes of a spray are; a few columns more are looked at.
inline bool empty(const Resampling &job, const Box &box) {
    const int first = box.left / FilledCells::columns, cells = box.right / FilledCells::columns - first + 1;
    if (cells > FilledCells::most) return false;
    const int64_t stride = FilledCells::stride(job.from_columns);
    const uint8_t *filled = job.filled + box.top * stride + first;
    uint64_t any = 0;
    for (int row = box.top; row <= box.bottom; ++row, filled += stride) any |= load<uint64_t>(filled);
    return any << (64 - 8 * cells) == 0;
}

// What neighbouring positions see in a row of pixels: the weights of four pixels, the first one at `index`.
struct RowOfTaps {
    static constexpr int32_t one = 1 << 14;
    Ints index, near, far;  // weights of the first two pixels, and of the others, in the halves of words
    explicit RowOfTaps(Floats u) : index(__builtin_convertvector(u, Ints)) {
        const CubicWeights<Floats> weights(u - __builtin_convertvector(index, Floats));
        const Ints w0 = fixed(weights.w[0]), w1 = fixed(weights.w[1]), w2 = fixed(weights.w[2]);
        near = (w0 & 0xffff) | w1 << 16;
        far = (w2 & 0xffff) | (one - w0 - w1 - w2) << 16;
    }
    static Ints fixed(Floats weight) {  // above -1
        return __builtin_convertvector(weight * static_cast<float>(one) + (static_cast<float>(one) + 0.5f), Ints) - one;
    }
    Floats of(const int16_t *pixels) const {
        return weighted_pairs(pixels, index, near) + weighted_pairs(pixels, index + 2, far);
    }
};

#if defined(__AVX512BW__)

// The same without gathers, where all four pixels of sixteen positions lie in a window.
struct RowOfWindow {
    static constexpr float widest = 26.0f;  // columns between the first and the last position: 32 less four taps and rounding
    RowOfTaps taps;
    __m512i near, far;
    explicit RowOfWindow(Floats u) : taps(u) {
        const Ints pairs = (taps.index | taps.index << 16) + 0x10000;
        near = reinterpret_cast<__m512i>(pairs);
        far = reinterpret_cast<__m512i>(pairs + 0x20002);
    }
    Floats of(const int16_t *pixels) const {
        const __m512i window = _mm512_loadu_si512(pixels);
        const __m512i left = _mm512_madd_epi16(_mm512_permutexvar_epi16(near, window), reinterpret_cast<__m512i>(taps.near));
        const __m512i right = _mm512_madd_epi16(_mm512_permutexvar_epi16(far, window), reinterpret_cast<__m512i>(taps.far));
        return reinterpret_cast<Floats>(_mm512_cvtepi32_ps(_mm512_add_epi32(left, right)));
    }
};

#endif

inline Floats cubic_at(Floats distance) {
    const Floats zero{};
    const Floats d = distance < zero ? -distance : distance;
    const Floats near = ((keys + 2) * d - (keys + 3)) * d * d + 1.0f, far = ((d - 5.0f) * d + 8.0f) * d * keys - 4.0f * keys;
    return d < zero + 1.0f ? near : d < zero + 2.0f ? far : zero;
}

typedef int16_t Counts __attribute__((vector_size(2 * lanes)));

inline Counts rounded(Floats values) {
    const Floats zero{};
    values = values > zero ? values : zero;
    return __builtin_convertvector(__builtin_convertvector(lesser(values, all(32767.0f)) + 0.5f, Ints), Counts);
}

// The pixels of a segment, row by row of its box.
template <class Row>
inline void resample_segment(const Resampling &job, const Segment &at, const Box &box, int16_t *to) {
    const int16_t *first = job.from + static_cast<int64_t>(box.top) * job.from_columns + box.left;
    for (int k = 0; k < spacing; k += lanes, to += lanes) {
        const Floats along = lane_numbers() + static_cast<float>(k), zero{};
        const Row row_of(along * at.step_u + (at.u - static_cast<float>(box.left + 1)));
        const Floats v = along * at.step_v + (at.v - static_cast<float>(box.top));
        const int16_t *pixels = first;
        Floats sum{};
        if (box.one_row()) {
            const Floats fraction = v > zero + 1.0f ? v - 1.0f : zero;
            const CubicWeights<Floats> down(lesser(fraction, all(1.0f)));
            for (int row = 0; row < 4; ++row, pixels += job.from_columns) sum += down.w[row] * row_of.of(pixels);
        } else {
            for (int row = 0; row <= box.bottom - box.top; ++row, pixels += job.from_columns)
                sum += cubic_at(v - static_cast<float>(row)) * row_of.of(pixels);
        }
        store(to, rounded(sum * (1.0f / RowOfTaps::one)));
    }
}

// Not a number where any pixel is negative or not a number. In four chains, because one would wait for itself.
float brightest(const float *pixels, int count) {
    constexpr int chains = 4, at_once = chains * lanes;
    const Floats zero{};
    Floats most[chains] = {};
    Ints wrong[chains] = {};
    int k = 0;
    for (; k + at_once <= count; k += at_once)
        for (int chain = 0; chain < chains; ++chain) {
            const Floats some = load<Floats>(pixels + k + chain * lanes);
            most[chain] = some > most[chain] ? some : most[chain];
            wrong[chain] |= ~(some >= zero);
        }
    float largest = 0.0f;
    int32_t any_wrong = 0;
    for (; k < count; ++k) {
        largest = greater(pixels[k], largest);
        any_wrong |= !(pixels[k] >= 0.0f);
    }
    for (int chain = 0; chain < chains; ++chain)
        for (int lane = 0; lane < lanes; ++lane) {
            largest = greater(most[chain][lane], largest);
            any_wrong |= wrong[chain][lane];
        }
    return any_wrong ? __builtin_nanf("") : largest;
}

void quantise(const float *pixels, float counts_per_unit, int16_t *to, int count) {
    for (int k = 0; k < count; ++k) to[k] = rounded(pixels[k] * counts_per_unit);
}

void find_filled(const int16_t *pixels, int count, uint8_t *filled) {
    constexpr int columns = FilledCells::columns;
    for (int cell = 0; cell < count / columns; ++cell) {
        uint64_t words[2];
        std::memcpy(words, pixels + cell * columns, sizeof words);
        filled[cell] = (words[0] | words[1]) != 0;
    }
    std::memset(filled + count / columns, 1, FilledCells::most);  // of pixels that are left over; and what nobody reads
}

void resample(const Resampling &job, int first_row, int end_row) {
    for (int row = first_row; row < end_row; ++row)
        for (int column = 0; column < job.columns; column += spacing) {
            int16_t *to = job.to + static_cast<int64_t>(row) * job.columns + column;
            const Segment at(job, row, column);
            const Box box(job, at);
            if (!box.inside || empty(job, box)) {
                std::memset(to, 0, sizeof(int16_t) * spacing);
                continue;
            }
#if defined(__AVX512BW__)
            if (box.right - box.left < RowOfWindow::widest + 4) {
                resample_segment<RowOfWindow>(job, at, box, to);
                continue;
            }
#endif
            resample_segment<RowOfTaps>(job, at, box, to);
        }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
