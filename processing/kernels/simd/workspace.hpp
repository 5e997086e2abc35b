// Memory of one slab in work.
#pragma once

#include <cstdlib>

#include "simd/sampling/sample.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Zeroed memory, aligned to cache lines.
class Memory {
public:
    explicit Memory(int64_t bytes) : start_(std::aligned_alloc(64, static_cast<size_t>((bytes + 127) / 64 * 64))) {
        if (!start_) out_of_memory();
        std::memset(start_, 0, static_cast<size_t>(bytes));
    }
    ~Memory() { std::free(start_); }
    Memory(const Memory &) = delete;
    Memory &operator=(const Memory &) = delete;
    template <class T>
    T *as() const {
        return static_cast<T *>(start_);
    }

private:
    void *start_;
};

inline int64_t floats_of_lines(const View *views, int n_views, int nx, int lines) {
    int64_t floats = 0;
    for (int i = 0; i < n_views; ++i)
        if (views[i].nodes) floats += static_cast<int64_t>(lines) * line_length(views[i], nx);
    return floats;
}

// Least and largest value of a channel in a tile; found at its edges and where it crosses nodes.
struct Extent {
    float least, most;
};

inline Extent extent_of(const PlaneTaps &taps, int channel, const Tile &tile, int spacing) {
    Extent extent{taps.line(0, channel)[tile.x0 / spacing], taps.line(0, channel)[tile.x0 / spacing]};
    for (int row = 0; row < tile.rows;) {
        const float *line = taps.line(row, channel);
        for (int k = tile.x0 / spacing; k <= (tile.x0 + block_columns) / spacing; ++k) {
            extent.least = line[k] < extent.least ? line[k] : extent.least;
            extent.most = line[k] > extent.most ? line[k] : extent.most;
        }
        const int next_node = row + spacing - ((tile.y0 + row) & (spacing - 1));
        row = row == tile.rows - 1 ? tile.rows : smaller(next_node, tile.rows - 1);
    }
    return extent;
}

// Where all views see the rows of a slab, in a few planes at once: kernels go through the planes of a column of blocks,
// because neighbouring planes see almost the same pixels. Mappings by nodes need much memory for each plane, and get fewer.
// What happens once per stack is not inline, so that compilers inline what happens for every block.
class PlaneStack {
public:
    static constexpr int rectified_depth = 8, mapped_depth = 4;
    [[gnu::noinline]] PlaneStack(const View *views, int n_views, int nx, int y0, int rows)
        : views_(views),
          n_views_(n_views),
          y0_(y0),
          rows_(rows),
          line_floats_(floats_of_lines(views, n_views, nx, rows * channels)),
          depth_(line_floats_ ? mapped_depth : rectified_depth),
          lines_(4 * line_floats_ * depth_),
          taps_(static_cast<int64_t>(sizeof(PlaneTaps)) * depth_ * n_views) {
        for (int plane = 0; plane < depth_; ++plane) {
            float *lines = lines_.as<float>() + line_floats_ * plane;
            for (int i = 0; i < n_views; ++i) {
                PlaneTaps &taps = taps_.as<PlaneTaps>()[plane * n_views + i];
                taps.lines = lines;
                taps.line_length = views[i].nodes ? line_length(views[i], nx) : 0;
                taps.channels = channels;
                lines += static_cast<int64_t>(rows) * channels * taps.line_length;
            }
        }
    }
    int depth() const { return depth_; }
    [[gnu::noinline]] void set(int z0, int z_end) {
        for (int z = z0; z < z_end; ++z)
            for (int i = 0; i < n_views_; ++i)
                set_plane(views_[i], z, y0_, rows_, taps_.as<PlaneTaps>()[(z - z0) * n_views_ + i]);
    }
    const PlaneTaps *plane(int number) const { return taps_.as<PlaneTaps>() + number * n_views_; }

private:
    static constexpr int channels = 2;
    const View *views_;
    int n_views_, y0_, rows_;
    int64_t line_floats_;
    int depth_;
    Memory lines_, taps_;
};

// Cells around all samples of a tile, the same for all images of a view.
inline CellBox cells_around(const View &view, const PlaneTaps &taps, const Tile &tile) {
    constexpr auto row_of = cell_of<Occupancy::cell_rows>, column_of = cell_of<Occupancy::cell_columns>;
    if (!view.nodes) {
        const double scale = view.scale[tile.z];
        const int column = static_cast<int>(scale * tile.x0 + view.shift_u[tile.z]);
        const int last = column + static_cast<int>(scale * (block_columns - 1)) + 2;
        return {taps.rows.first_cell, taps.rows.end_cell, column_of(column), column_of(last) + 1};
    }
    const Clamp last(view);
    const Extent u = extent_of(taps, 0, tile, view.spacing), v = extent_of(taps, 1, tile, view.spacing);
    const auto pixel = [](float at, float limit) { return static_cast<int>(Clamp::between(at, limit)); };
    return {row_of(pixel(v.least, last.v)), row_of(pixel(v.most, last.v) + 1) + 1, column_of(pixel(u.least, last.u)),
            column_of(pixel(u.most, last.u) + 1) + 1};
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
