// Samples of any mapping, known at nodes and linear in between.
#pragma once

#include "simd/sampling/tile.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Nodes that whole blocks of a row need; those beyond the lattice repeat the last one.
inline int line_length(const View &view, int nx) {
    return (nx + block_columns - 1) / block_columns * block_columns / view.spacing + 1;
}

// One channel of the nodes of the row of constant z and y, linear between four nodes each.
inline void node_line(const View &view, int channel, int z, int y, int length, float *line) {
    const float step = 1.0f / static_cast<float>(view.spacing);
    const float along_z = static_cast<float>(z % view.spacing) * step, along_y = static_cast<float>(y % view.spacing) * step;
    const int n = view.nodes_x, known = smaller(n, length);
    const int64_t plane = static_cast<int64_t>(view.nodes_y) * n;
    const float *near = view.nodes + (static_cast<int64_t>(channel) * view.nodes_z + z / view.spacing) * plane +
                        static_cast<int64_t>(y / view.spacing) * n;
    for (int k = 0; k < known; ++k) {
        const float front = near[k] + along_y * (near[k + n] - near[k]);
        const float back = near[plane + k] + along_y * (near[plane + k + n] - near[plane + k]);
        line[k] = front + along_z * (back - front);
    }
    for (int k = known; k < length; ++k) line[k] = line[known - 1];
}

// Values at the voxels of a block, linear between the nodes of a line.
inline void spread_line(const float *line, int spacing, int x0, float *out) {
    const float step = 1.0f / static_cast<float>(spacing);
    line += x0 / spacing;
    for (int k = 0; k < block_columns; k += spacing, ++line) {
        const float slope = (line[1] - line[0]) * step;
        for (int j = 0; j < spacing; ++j) out[k + j] = line[0] + slope * static_cast<float>(j);
    }
}

struct Clamp {
    float u, v;  // the last position that still has a right and a lower neighbour, both in the frame of zeros
    explicit Clamp(const View &view)
        : u(static_cast<float>(view.columns - 2)), v(static_cast<float>(view.rows - 2)) {}
    static float between(float x, float last) {
        x = x > 0.0f ? x : 0.0f;  // not-a-number becomes 0
        return x < last ? x : last;
    }
    static Floats between(Floats x, float last) {
        const Floats zero{}, most = zero + last;
        x = x > zero ? x : zero;
        return x < most ? x : most;
    }
};

#if defined(__AVX512BW__)

// A segment between two nodes sixteen voxels apart. Without gathers, where its pixels fit into a window of few rows.
struct NodeSegment {
    float u0, u1, v0, v1;
    NodeSegment(const float *u, const float *v) : u0(u[0]), u1(u[1]), v0(v[0]), v1(v[1]) {}
    float left() const { return u0 < u1 ? u0 : u1; }
    float right() const { return u0 < u1 ? u1 : u0; }
    float top() const { return v0 < v1 ? v0 : v1; }
    float bottom() const { return v0 < v1 ? v1 : v0; }
    bool fits(const Clamp &last) const {
        constexpr float most_columns = 29.0f, most_rows = 6.0f;
        return left() >= 0 && right() <= last.u && top() >= 0 && bottom() <= last.v - 2 &&
               right() - left() <= most_columns && bottom() - top() <= most_rows;
    }
};

// What a view sees along a segment that fits, in the same two rows or in a few of which each adds with the weight
// 1 - |distance|. Not inline: with the registers of its caller it would need more than there are.
[[gnu::noinline]] Floats sample_segment(const View &view, const NodeSegment &at) {
    const float left = at.left(), top = at.top(), bottom = at.bottom();
    const int first_column = static_cast<int>(left), first_row = static_cast<int>(top);
    const int more_rows = static_cast<int>(bottom) - first_row;
    const Floats lane = lane_numbers() * (1.0f / lanes), zero{}, one = zero + 1.0f;
    const Floats at_u = lane * (at.u1 - at.u0) + (at.u0 - static_cast<float>(first_column));
    Floats distance = lane * (at.v1 - at.v0) + (at.v0 - static_cast<float>(first_row));
    const Ints column = __builtin_convertvector(at_u, Ints);
    const auto weight = reinterpret_cast<__m512i>(horizontal_weights(at_u - __builtin_convertvector(column, Floats)));
    const auto index = reinterpret_cast<__m512i>((column | column << 16) + 0x10000);
    const int16_t *pixels = view.pixels + static_cast<int64_t>(first_row) * view.columns + first_column;
    const auto next_row = [&] {
        const __m512i pairs = _mm512_permutexvar_epi16(index, _mm512_loadu_si512(pixels));
        pixels += view.columns;
        return reinterpret_cast<Floats>(_mm512_cvtepi32_ps(_mm512_madd_epi16(pairs, weight)));
    };
    if (!more_rows) {
        const Floats above = next_row(), below = next_row();
        return above + distance * (below - above);
    }
    Floats seen{};
    for (int row = 0; row < more_rows + 2; ++row, distance -= one) {
        const auto away = reinterpret_cast<Floats>(_mm512_abs_ps(reinterpret_cast<__m512>(distance)));
        seen += reinterpret_cast<Floats>(_mm512_max_ps(reinterpret_cast<__m512>(one - away), _mm512_setzero_ps())) * next_row();
    }
    return seen;
}

#endif

// Voxels of a row from `first` on, each by its four pixels. Images carry a frame of zeros.
template <Combine how>
inline void sample_gathered(const View &view, const float *line_u, const float *line_v, int x0, int first,
                            const Clamp &last, float factor, float *row) {
    alignas(64) float u[block_columns], v[block_columns];
    spread_line(line_u, view.spacing, x0, u);
    spread_line(line_v, view.spacing, x0, v);
    for (int k = first; k < block_columns; k += lanes) {
        const Floats at_u = Clamp::between(load<Floats>(u + k), last.u);
        const Floats at_v = Clamp::between(load<Floats>(v + k), last.v);
        const Ints iu = __builtin_convertvector(at_u, Ints), iv = __builtin_convertvector(at_v, Ints);
        const Ints weight = horizontal_weights(at_u - __builtin_convertvector(iu, Floats)), at = iv * view.columns + iu;
        const Floats above = weighted_pairs(view.pixels, at, weight);
        const Floats below = weighted_pairs(view.pixels, at + view.columns, weight);
        const Floats down = at_v - __builtin_convertvector(iv, Floats);
        combine<how>(row + k, above + down * (below - above), factor);
    }
}

// Any mapping, by the lines of nodes of a plane.
template <Combine how>
inline void sample_nodes(const View &view, const PlaneTaps &taps, const Tile &tile, float factor, Block &block) {
    const Clamp last(view);
    for (int row = 0; row < tile.rows; ++row) {
        const float *line_u = taps.line(row, 0), *line_v = taps.line(row, 1);
#if defined(__AVX512BW__)
        if (view.spacing == lanes) {
            int k = 0;
            for (int node = tile.x0 / lanes; k < block_columns; k += lanes, ++node) {
                const NodeSegment at(line_u + node, line_v + node);
                if (!at.fits(last)) break;
                combine<how>(block.rows[row] + k, sample_segment(view, at), factor);
            }
            if (k < block_columns) sample_gathered<how>(view, line_u, line_v, tile.x0, k, last, factor, block.rows[row]);
            continue;
        }
#endif
        sample_gathered<how>(view, line_u, line_v, tile.x0, 0, last, factor, block.rows[row]);
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
