// The planes of a tile of SMART.
#pragma once

#include "simd/project.hpp"
#include "simd/workspace.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// The planes of a tile, and where each view sees the rows of a slab in them. With projections also where these rows
// meet its image.
class TilePlanes {
public:
    TilePlanes(const View *views, int n_views, const Shape &shape, int y0, int rows, int channels)
        : views_(views),
          n_views_(n_views),
          y0_(y0),
          rows_(rows),
          nz_(shape.nz),
          lines_(4 * smart_planes * floats_of_lines(views, n_views, shape.nx, rows * channels)) {
        float *lines = lines_.as<float>();
        for (auto &plane : taps)
            for (int i = 0; i < n_views; ++i) {
                const int length = views[i].nodes ? line_length(views[i], shape.nx) : 0;
                plane[i].lines = lines;
                plane[i].line_length = length;
                plane[i].channels = channels;
                lines += static_cast<int64_t>(rows) * channels * length;
            }
    }
    void set(int first, const Projection *projections) {
        for (int z = first; z < smaller(first + smart_planes, nz_); ++z)
            for (int i = 0; i < n_views_; ++i) {
                set_plane(views_[i], z, y0_, rows_, taps[z - first][i]);
                if (views_[i].nodes || !projections[i].pixels) continue;
                ImageRows *rows = image[i] + z - first;
                image_rows(views_[i], z, y0_, rows_, projections[i], *rows);
                rows->changed = z > first ? changes(rows[-1], *rows) : 0;
            }
    }

    PlaneTaps taps[smart_planes][max_views];
    ImageRows image[max_views][smart_planes];

private:
    const View *views_;
    int n_views_, y0_, rows_, nz_;
    Memory lines_;
};

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
