// What a view sees at the voxels of a block: bilinear interpolation of its image, zero outside.
#pragma once

#include "simd/sampling/nodes.hpp"
#include "simd/sampling/rectified.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

inline void set_plane(const View &view, int z, int y0, int rows, PlaneTaps &taps) {
    if (!view.nodes) {
        taps.rows = row_taps(view, z, y0, rows);
        taps.columns = Columns({view.shift_u[z], view.scale[z]});
        return;
    }
    float *line = taps.lines;
    for (int row = 0; row < rows; ++row)
        for (int channel = 0; channel < taps.channels; ++channel, line += taps.line_length)
            node_line(view, channel, z, y0 + row, taps.line_length, line);
}

template <Combine how>
inline void sample(const View &view, const PlaneTaps &taps, const Tile &tile, float factor, Block &block) {
    if (view.nodes)
        sample_nodes<how>(view, taps, tile, factor, block);
    else
        sample_rectified<how>(view, taps, tile, factor, block);
}

// The product of what some views see. Samples have up to 29 bits, so that a float holds the product of two before it
// is scaled: every other view does without.
inline void sample_product(const View *views, int n_views, const PlaneTaps *taps, const Tile &tile, Block &block) {
    for (int i = 0; i < n_views; ++i) {
        float factor = views[i].unit * sample_unit;
        if (i % 2 == 0 && i + 1 < n_views) factor *= views[i + 1].unit * sample_unit;
        if (i == 0)
            sample<Combine::set>(views[i], taps[i], tile, factor, block);
        else if (i % 2 == 0)
            sample<Combine::multiply>(views[i], taps[i], tile, factor, block);
        else
            sample<Combine::multiply_raw>(views[i], taps[i], tile, factor, block);
    }
}

inline void sample_minimum(const View *views, int n_views, const PlaneTaps *taps, const Tile &tile, Block &block) {
    sample<Combine::set>(views[0], taps[0], tile, views[0].unit * sample_unit, block);
    for (int i = 1; i < n_views; ++i)
        sample<Combine::limit>(views[i], taps[i], tile, views[i].unit * sample_unit, block);
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
