// Samples of rectified views, from windows of contiguous pixels.
#pragma once

#include "simd/sampling/tile.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Where the rows of a slab are seen in a plane.
inline RowTaps row_taps(const View &view, int z, int y0, int rows) {
    RowTaps taps;
    for (int row = 0; row < rows; ++row) {
        const double position = view.scale[z] * (y0 + row) + view.shift_v[z];
        const int at = static_cast<int>(position);
        if (row == 0) taps.first_cell = cell_of<Occupancy::cell_rows>(at);
        if (row == rows - 1) taps.end_cell = cell_of<Occupancy::cell_rows>(at + 1) + 1;
        taps.above[row] = at * view.columns;
        taps.weight[row] = vertical_weight(static_cast<float>(position - at));
    }
    return taps;
}

#if defined(__AVX512BW__)

// Both halves of a block from one window, which moves down by no more than one row: every row is read once.
template <Combine how>
inline void sample_shared(const View &view, const RowTaps &rows, const Taps (&taps)[parts], const Tile &tile, float factor, Block &block) {
    const int16_t *above = view.pixels + taps[0].first + rows.above[0];
    Window top = _mm512_loadu_si512(above), bottom = _mm512_loadu_si512(above + view.columns);
    for (int row = 0; row < tile.rows; ++row) {
        const int16_t *at = view.pixels + taps[0].first + rows.above[row];
        if (at != above) {
            above = at;
            top = bottom;
            bottom = _mm512_loadu_si512(above + view.columns);
        }
        const Window window = between(top, bottom, rows.weight[row]);
        for (int part = 0; part < parts; ++part)
            combine<how>(block.rows[row] + part * lanes, pick(window, taps[part]), factor);
    }
}

#endif

template <Combine how, bool compact>
inline void sample_windows(const View &view, const RowTaps &rows, const Taps (&taps)[parts], const Tile &tile, float factor, Block &block) {
    for (int row = 0; row < tile.rows; ++row) {
        const int16_t *above = view.pixels + rows.above[row], *below = above + view.columns;
        for (int part = 0; part < parts; ++part) {
            const Window window = blend<compact>(above, below, rows.weight[row], taps[part]);
            combine<how>(block.rows[row] + part * lanes, pick(window, taps[part]), factor);
        }
    }
}

template <Combine how>
inline void sample_rectified(const View &view, const PlaneTaps &plane, const Tile &tile, float factor, Block &block) {
    Taps taps[parts];
    plane.columns.taps(tile.x0, taps);
#if defined(__AVX512BW__)
    if (plane.columns.compact()) return sample_shared<how>(view, plane.rows, taps, tile, factor, block);
#else
    if (plane.columns.compact()) return sample_windows<how, true>(view, plane.rows, taps, tile, factor, block);
#endif
    sample_windows<how, false>(view, plane.rows, taps, tile, factor, block);
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
