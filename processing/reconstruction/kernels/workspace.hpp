// Memory of one slab in work.
#pragma once

#include <cstdlib>

#include "sample.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int max_views = 8;

// Zeroed memory, aligned to cache lines.
class Memory {
public:
    explicit Memory(int64_t bytes) : start_(std::aligned_alloc(64, static_cast<size_t>((bytes + 127) / 64 * 64))) {
        if (!start_) std::abort();
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

// Where all views see the rows of a slab, plane after plane. Channels of nodes: 2 (u, v), or 3 with the area.
class SlabTaps {
public:
    SlabTaps(const View *views, int n_views, int nx, int y0, int rows, int channels)
        : views_(views),
          n_views_(n_views),
          y0_(y0),
          rows_(rows),
          lines_(4 * floats_of_lines(views, n_views, nx, rows * channels)) {
        float *lines = lines_.as<float>();
        for (int i = 0; i < n_views; ++i) {
            taps[i].lines = lines;
            taps[i].line_length = views[i].nodes ? line_length(views[i], nx) : 0;
            taps[i].channels = channels;
            lines += static_cast<int64_t>(rows) * channels * taps[i].line_length;
        }
    }
    void set(int z) {
        for (int i = 0; i < n_views_; ++i) set_plane(views_[i], z, y0_, rows_, taps[i]);
    }

    PlaneTaps taps[max_views];

private:
    const View *views_;
    int n_views_, y0_, rows_;
    Memory lines_;
};

// Whether every rectified view may see something in the tile.
inline bool occupied(const View *views, int n_views, const SlabTaps &slab, const Tile &tile) {
    for (int i = 0; i < n_views; ++i) {
        const View &view = views[i];
        if (view.nodes) continue;
        const int column = static_cast<int>(view.scale[tile.z] * tile.x0 + view.shift_u[tile.z]);
        if (!view.occupancy.at(slab.taps[i].rows.first_row, column)) return false;
    }
    return true;
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
