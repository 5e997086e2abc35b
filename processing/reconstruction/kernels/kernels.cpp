// Line of sight, SMART and resampling. This file is compiled once per instruction set; all it defines lives in the
// namespace of that set and calls no inline function of the standard library, so that the linker cannot hand
// code for a newer processor to an older one.
#include "instruction_set.hpp"
#include "output.hpp"
#include "project.hpp"
#include "resample.hpp"

#define TOMOSHADOW_TEXT_(name) #name
#define TOMOSHADOW_TEXT(name) TOMOSHADOW_TEXT_(name)

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int every_view[max_views] = {0, 1, 2, 3, 4, 5, 6, 7};

void line_of_sight(const LineOfSight &job, int slab) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, y0 = slab * sight_rows, rows = smaller(sight_rows, job.shape.ny - y0);
    SlabTaps slab_taps(job.views, job.n_views, nx, y0, rows, 2);
    Staging staging(job.format, nx, rows);
    Block block;
    for (int z = 0; z < job.shape.nz; ++z) {
        slab_taps.set(z);
        for (int x0 = 0; x0 < nx; x0 += block_columns) {
            const Tile tile{z, y0, rows, x0};
            if (!occupied(job.views, job.n_views, slab_taps, tile)) {
                staging.put_zeros(tile);
                continue;
            }
            if (job.method == Method::minimum)
                sample_minimum(job.views, job.n_views, slab_taps.taps, tile, block);
            else
                sample_product(job.views, every_view, job.n_views, slab_taps.taps, tile, block);
            if (job.method == Method::geometric_mean) take_root(block, rows, job.n_views);
            staging.put(tile, block);
        }
        staging.write(job.shape, z, y0, rows, job.volume);
    }
    finish_streams();
}

// Multiply a tile by the ratios of the chosen views; false if nothing is left in it.
inline bool update(const SmartPass &job, const int *chosen, int count, const SlabTaps &slab, const Tile &tile,
                   Block &block) {
    if (all_zero(block, tile.rows)) return false;
    if (!count) return true;
    Block ratio;
    sample_product(job.views, chosen, count, slab.taps, tile, ratio);
    for (int row = 0; row < tile.rows; ++row)
        for (int k = 0; k < block_columns; ++k) block.rows[row][k] *= ratio.rows[row][k];
    return !all_zero(block, tile.rows);
}

inline void move_rows(const SmartPass &job, const Tile &tile, Block &block, bool to_volume) {
    const size_t columns = static_cast<size_t>(smaller(block_columns, job.shape.nx - tile.x0));
    if (!to_volume) std::memset(&block, 0, sizeof block);
    for (int row = 0; row < tile.rows; ++row) {
        float *voxels =
            job.volume + (static_cast<int64_t>(tile.z) * job.shape.ny + tile.y0 + row) * job.shape.nx + tile.x0;
        if (to_volume)
            std::memcpy(voxels, block.rows[row], sizeof(float) * columns);
        else
            std::memcpy(block.rows[row], voxels, sizeof(float) * columns);
    }
}

void smart_pass(const SmartPass &job, int slab, const Projection *projections) {
    const FlushSubnormals flush;
    Block block;
    const int nx = job.shape.nx, y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    const int64_t stride = nx + 2 * guard + block_columns;
    const Memory memory(stride * smart_rows * 4);
    float *padded = memory.as<float>();
    int chosen[max_views], count = 0;
    for (int i = 0; i < job.n_views; ++i)
        if (job.update[i]) chosen[count++] = i;
    SlabTaps slab_taps(job.views, job.n_views, nx, y0, rows, 3);
    for (int z = 0; z < job.shape.nz; ++z) {
        slab_taps.set(z);
        PlaneRows plane{padded + guard, stride, z, y0, rows, nx, 0};
        for (int x0 = 0; x0 < nx; x0 += block_columns) {
            const Tile tile{z, y0, rows, x0};
            move_rows(job, tile, block, false);
            const bool left = update(job, chosen, count, slab_taps, tile, block);
            if (count) move_rows(job, tile, block, true);
            const size_t columns = static_cast<size_t>(smaller(block_columns, nx - x0));
            for (int row = 0; row < rows; ++row)
                std::memcpy(padded + guard + row * stride + x0, block.rows[row], sizeof(float) * columns);
            if (!left) continue;
            plane.begin = smaller(plane.begin, x0);
            plane.end = x0 + static_cast<int>(columns);
        }
        for (int i = 0; i < job.n_views && plane.begin < plane.end; ++i)
            if (job.project[i]) project(job.views[i], plane, slab_taps.taps[i], projections[i]);
    }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{
    TOMOSHADOW_TEXT(TOMOSHADOW_ISA), line_of_sight, smart_pass, resample, brightest, quantise};

}  // namespace tomoshadow::TOMOSHADOW_ISA
