// What a view sees at the voxels of a tile: bilinear interpolation of its image, zero outside.
#pragma once

#include "job.hpp"
#include "lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Voxels (z, y0 .. y0 + rows - 1, x0 .. x0 + columns - 1).
struct Tile {
    int z, y0, rows, x0, columns;
};

struct alignas(64) Block {
    Row rows[slab_rows];
};

// Image rows that the rows of a slab can touch: slab_rows steps of up to max_step, neighbours included.
constexpr int touched_rows = 20;

// Separable: first along x once per image row, then along y once per voxel row.
inline void sample_rectified(const View &view, const Tile &tile, Block &out) {
    const double scale = view.scale[tile.z];
    Taps taps;
    set_taps(taps, scale * tile.x0 + view.shift_u[tile.z], scale, tile.columns);
    const double top = scale * tile.y0 + view.shift_v[tile.z];
    const int first = static_cast<int>(top);
    const int count = static_cast<int>(top + scale * (tile.rows - 1)) - first + 2;
    alignas(64) Row along_x[touched_rows];
    const float *pixels = view.image.pixels + static_cast<int64_t>(first) * view.image.columns;
    for (int row = 0; row < count; ++row)
        interpolate(pixels + static_cast<int64_t>(row) * view.image.columns, taps, along_x[row]);
    for (int row = 0; row < tile.rows; ++row) {
        const double position = top + scale * row;
        const int at = static_cast<int>(position);
        const float fraction = static_cast<float>(position - at);
        const float *above = along_x[at - first], *below = along_x[at - first + 1];
        for (int k = 0; k < tile.columns; ++k) out.rows[row][k] = above[k] + fraction * (below[k] - above[k]);
    }
}

// One channel of the nodes along voxels (z, y, x0 ..), linear between nodes. x0 is a multiple of the spacing.
inline void node_row(const View &view, int channel, int z, int y, int x0, int columns, float *out) {
    const int spacing = view.spacing;
    const float step = 1.0f / static_cast<float>(spacing);
    const float along_z = static_cast<float>(z % spacing) * step, along_y = static_cast<float>(y % spacing) * step;
    const int64_t plane = static_cast<int64_t>(view.nodes_y) * view.nodes_x;
    const float *near = view.nodes + (static_cast<int64_t>(channel) * view.nodes_z + z / spacing) * plane +
                        static_cast<int64_t>(y / spacing) * view.nodes_x + x0 / spacing;
    const auto node = [&](const float *at) {
        const float front = at[0] + along_y * (at[view.nodes_x] - at[0]);
        const float back = at[plane] + along_y * (at[plane + view.nodes_x] - at[plane]);
        return front + along_z * (back - front);
    };
    float left = node(near);
    for (int k = 0; k < columns; k += spacing) {
        const float right = node(++near), slope = (right - left) * step;
        for (int j = 0; j < spacing; ++j) out[k + j] = left + slope * static_cast<float>(j);
        left = right;
    }
}

struct Clamp {
    float u, v;  // the last position that still has a right and a lower neighbour, both in the frame of zeros
    explicit Clamp(const Image &image)
        : u(static_cast<float>(image.columns - 2)), v(static_cast<float>(image.rows - 2)) {}
    static float between(float x, float last) {
        x = x > 0.0f ? x : 0.0f;  // not-a-number becomes 0
        return x < last ? x : last;
    }
};

// Any mapping: the position of every voxel, then its four pixels. Images carry a frame of zeros.
inline void sample_nodes(const View &view, const Tile &tile, Block &out) {
    const Clamp last(view.image);
    const int columns = view.image.columns;
    const float *pixels = view.image.pixels;
    alignas(64) Row u, v;
    for (int row = 0; row < tile.rows; ++row) {
        node_row(view, 0, tile.z, tile.y0 + row, tile.x0, tile.columns, u);
        node_row(view, 1, tile.z, tile.y0 + row, tile.x0, tile.columns, v);
        float *seen = out.rows[row];
        for (int k = 0; k < tile.columns; ++k) {
            const float at_u = Clamp::between(u[k], last.u), at_v = Clamp::between(v[k], last.v);
            const int iu = static_cast<int>(at_u), iv = static_cast<int>(at_v), at = iv * columns + iu;
            const float fu = at_u - static_cast<float>(iu), fv = at_v - static_cast<float>(iv);
            const float above = pixels[at] + fu * (pixels[at + 1] - pixels[at]);
            const float below = pixels[at + columns] + fu * (pixels[at + columns + 1] - pixels[at + columns]);
            seen[k] = above + fv * (below - above);
        }
    }
}

inline void sample(const View &view, const Tile &tile, Block &out) {
    if (view.nodes)
        sample_nodes(view, tile, out);
    else
        sample_rectified(view, tile, out);
}

inline bool all_zero(const Block &block, const Tile &tile) {
    for (int row = 0; row < tile.rows; ++row) {
        int32_t any = 0;
        for (int k = 0; k < tile.columns; ++k) any |= block.rows[row][k] != 0.0f;
        if (any) return false;
    }
    return true;
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
