// Tiles of voxels, and what samples of a view do to them.
#pragma once

#include "job.hpp"
#include "simd/sampling/windows.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Voxels (z, y0 .. y0 + rows - 1, x0 .. x0 + block_columns - 1); columns beyond the volume are computed, not kept.
struct Tile {
    int z, y0, rows, x0;
};

// Values of the voxels of a tile.
union alignas(64) Block {
    float rows[sight_rows][block_columns];
    Floats vectors[sight_rows][parts];
    // Vector by vector: compilers copy arrays of them word by word.
    [[gnu::always_inline]] void set(int row, const Floats (&values)[parts]) {
#pragma GCC unroll 8
        for (int part = 0; part < parts; ++part) vectors[row][part] = values[part];
    }
};

// How the samples of a view enter a block: they replace, multiply or limit what is there. Samples are in units of
// the image times `factor`.
enum class Combine { set, multiply, multiply_raw, limit };

template <Combine how>
inline void combine(float *at, Floats seen, float factor) {
    if (how != Combine::multiply_raw) seen = seen * factor;
    if (how != Combine::set) {
        const Floats before = load<Floats>(at);
        seen = how == Combine::limit ? (seen < before ? seen : before) : before * seen;
    }
    store(at, seen);
}

// Rows of an image between which the rows of a tile are seen: where the upper one starts, and the weight of the lower
// one; and the rows of cells that they lie in. The same for all images of a view.
struct RowTaps {
    int32_t above[sight_rows];
    int32_t weight[sight_rows];
    int first_cell, end_cell;
};

// Pixels are never negative, and to divide such numbers is quicker.
template <int pixels>
inline int cell_of(int pixel) {
    return static_cast<int>(static_cast<unsigned>(pixel) / pixels);
}

// What a slab needs of a view in one plane, whatever the tile.
struct PlaneTaps {
    RowTaps rows;     // rectified
    Columns columns;  // rectified
    float *lines;     // by nodes: u, v and maybe area of every row
    int line_length, channels;

    const float *line(int row, int channel) const {
        return lines + (static_cast<int64_t>(row) * channels + channel) * line_length;
    }
};

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
