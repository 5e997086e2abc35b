// The way back: what the rows of a slab in one plane add to the image of a view.
#pragma once

#include "sample.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int guard = 64;  // zeros before and after a row of voxels

// Rows y0 .. y0 + rows - 1 of plane z, with `stride` floats from row to row and zeros around each.
struct PlaneRows {
    const float *voxels;
    int64_t stride;
    int z, y0, rows;
    int begin, end;  // columns outside are zero
};

// Image rows that meet the rows of a slab: each lies a fraction below row above - 1 of the slab; rows -1 and `rows` are
// zero.
struct BetweenRows {
    static constexpr int most = static_cast<int>((smart_rows + 1) * max_step) + 2;
    int count;
    int above[most];
    float fraction[most];
};

// Add what a vector of pixels sees of the slab, image row by image row. Each row of voxels is interpolated once.
inline void add_column(const PlaneRows &plane, const FloatTaps &taps, const BetweenRows &between, float *pixels,
                       int64_t columns, int count) {
    const float *next = plane.voxels - guard;
    Floats above{}, below = interpolate(next, taps);
    int row = 0;  // of `above`
    for (int v = 0; v < between.count; ++v, pixels += columns) {
        for (; row < between.above[v]; ++row) {
            next += plane.stride;
            above = below;
            below = row + 1 < plane.rows ? interpolate(next, taps) : Floats{};
        }
        const Floats seen = above + between.fraction[v] * (below - above);
        if (count == lanes) {
            store(pixels, load<Floats>(pixels) + seen);
            continue;
        }
        for (int k = 0; k < count; ++k) pixels[k] += seen[k];
    }
}

// Pixel-driven: every pixel adds the bilinear interpolation of the plane where its line of sight meets it.
// Rows of other slabs count as zero: each slab adds its own share.
inline void project_rectified(const View &view, const PlaneRows &plane, const Projection &to) {
    const double scale = view.scale[plane.z], step = 1.0 / scale;
    const double shift_u = view.shift_u[plane.z], shift_v = view.shift_v[plane.z];
    const int u_begin = larger(0, ceil_of(scale * (plane.begin - 1) + shift_u));
    const int u_end = smaller(to.columns, floor_of(scale * plane.end + shift_u) + 1);
    const int v_begin = larger(to.first_row, ceil_of(scale * (plane.y0 - 1) + shift_v));
    const int v_end = smaller(to.first_row + to.rows, floor_of(scale * (plane.y0 + plane.rows) + shift_v) + 1);
    BetweenRows between;
    between.count = 0;
    for (int v = v_begin; v < v_end; ++v, ++between.count) {
        const double position = (v - shift_v) * step - plane.y0 + 1;
        const int above = larger(0, smaller(plane.rows, static_cast<int>(position)));
        between.above[between.count] = above;
        between.fraction[between.count] = static_cast<float>(position - above);
    }
    float *pixels = to.pixels + static_cast<int64_t>(v_begin - to.first_row) * to.columns;
    for (int u = u_begin; u < u_end; u += lanes) {
        const FloatTaps taps = float_taps((u - shift_u) * step + guard, step);
        add_column(plane, taps, between, pixels + u, to.columns, smaller(lanes, u_end - u));
    }
}

// Voxel-driven, the adjoint of sampling: every voxel spreads its intensity, times the pixel area it covers, over
// the four pixels it is sampled from.
inline void project_nodes(const View &view, const PlaneRows &plane, const PlaneTaps &taps, const Projection &to) {
    const Clamp last(view);
    alignas(64) float u[block_columns], v[block_columns], area[block_columns];
    for (int row = 0; row < plane.rows; ++row) {
        const float *voxels = plane.voxels + row * plane.stride;
        for (int x0 = plane.begin / block_columns * block_columns; x0 < plane.end; x0 += block_columns) {
            spread_line(taps.line(row, 0), view.spacing, x0, u);
            spread_line(taps.line(row, 1), view.spacing, x0, v);
            spread_line(taps.line(row, 2), view.spacing, x0, area);
            for (int k = 0; k < smaller(block_columns, plane.end - x0); ++k) {
                if (voxels[x0 + k] == 0.0f) continue;
                const float at_u = Clamp::between(u[k], last.u), at_v = Clamp::between(v[k], last.v);
                const int iu = static_cast<int>(at_u), iv = static_cast<int>(at_v);
                const float fu = at_u - static_cast<float>(iu), fv = at_v - static_cast<float>(iv);
                const float value = voxels[x0 + k] * area[k], below = value * fv, above = value - below;
                float *pixels = to.pixels + static_cast<int64_t>(iv - to.first_row) * to.columns + iu;
                pixels[0] += above - above * fu;
                pixels[1] += above * fu;
                pixels[to.columns] += below - below * fu;
                pixels[to.columns + 1] += below * fu;
            }
        }
    }
}

inline void project(const View &view, const PlaneRows &plane, const PlaneTaps &taps, const Projection &to) {
    if (view.nodes)
        project_nodes(view, plane, taps, to);
    else
        project_rectified(view, plane, to);
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
