// Line of sight and SMART. This file is compiled once per instruction set; all it defines lives in the
// namespace of that set and calls no inline function of the standard library, so that the linker cannot hand
// code for a newer processor to an older one.
#include <cmath>
#include <cstdlib>

#include "instruction_set.hpp"
#include "project.hpp"

#define TOMOSHADOW_TEXT_(name) #name
#define TOMOSHADOW_TEXT(name) TOMOSHADOW_TEXT_(name)

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

inline void multiply(Block &block, const Block &seen, const Tile &tile) {
    for (int row = 0; row < tile.rows; ++row)
        for (int k = 0; k < tile.columns; ++k) block.rows[row][k] *= seen.rows[row][k];
}

inline void take_minimum(Block &block, const Block &seen, const Tile &tile) {
    for (int row = 0; row < tile.rows; ++row)
        for (int k = 0; k < tile.columns; ++k)
            block.rows[row][k] = seen.rows[row][k] < block.rows[row][k] ? seen.rows[row][k] : block.rows[row][k];
}

// The n-th root; by square roots alone where n is a power of two.
inline void take_root(Block &block, const Tile &tile, int n) {
    const bool power_of_two = (n & (n - 1)) == 0;
    for (int row = 0; row < tile.rows; ++row) {
        float *values = block.rows[row];
        for (int roots = n; power_of_two && roots > 1; roots /= 2)
            for (int k = 0; k < tile.columns; ++k) values[k] = ::sqrtf(values[k] > 0.0f ? values[k] : 0.0f);
        for (int k = 0; !power_of_two && k < tile.columns; ++k)
            values[k] = values[k] > 0.0f ? ::powf(values[k], 1.0f / static_cast<float>(n)) : 0.0f;
    }
}

inline void combine(const LineOfSight &job, const Tile &tile, Block &block) {
    alignas(64) Block seen;
    sample(job.views[0], tile, block);
    for (int i = 1; i < job.n_views && !all_zero(block, tile); ++i) {
        sample(job.views[i], tile, seen);
        if (job.method == Method::minimum)
            take_minimum(block, seen, tile);
        else
            multiply(block, seen, tile);
    }
    if (job.method == Method::geometric_mean) take_root(block, tile, job.n_views);
}

void line_of_sight(const LineOfSight &job, int slab) {
    const FlushSubnormals flush;
    alignas(64) Block block;
    const int y0 = slab * slab_rows, rows = smaller(slab_rows, job.shape.ny - y0);
    for (int z = 0; z < job.shape.nz; ++z)
        for (int x0 = 0; x0 < job.shape.nx; x0 += tile_columns) {
            const Tile tile{z, y0, rows, x0, smaller(tile_columns, job.shape.nx - x0)};
            combine(job, tile, block);
            for (int row = 0; row < rows; ++row) {
                const int64_t at = (static_cast<int64_t>(z) * job.shape.ny + y0 + row) * job.shape.nx + x0;
                if (job.volume)
                    std::memcpy(job.volume + at, block.rows[row], sizeof(float) * tile.columns);
                else
                    store_halves(job.volume_16 + at, block.rows[row], tile.columns);
            }
        }
}

// Multiply a tile by the ratios; false if nothing is left in it.
inline bool update(const SmartPass &job, const Tile &tile, Block &block) {
    alignas(64) Block ratio;
    for (int i = 0; i < job.n_views; ++i) {
        if (all_zero(block, tile)) return false;
        if (!job.update[i]) continue;
        sample(job.views[i], tile, ratio);
        multiply(block, ratio, tile);
    }
    return !all_zero(block, tile);
}

inline void move_rows(const SmartPass &job, const Tile &tile, Block &block, bool to_volume) {
    for (int row = 0; row < tile.rows; ++row) {
        float *voxels =
            job.volume + (static_cast<int64_t>(tile.z) * job.shape.ny + tile.y0 + row) * job.shape.nx + tile.x0;
        if (to_volume)
            std::memcpy(voxels, block.rows[row], sizeof(float) * tile.columns);
        else
            std::memcpy(block.rows[row], voxels, sizeof(float) * tile.columns);
    }
}

void smart_pass(const SmartPass &job, int slab, const Projection *projections) {
    const FlushSubnormals flush;
    alignas(64) Block block;
    const int nx = job.shape.nx, y0 = slab * slab_rows, rows = smaller(slab_rows, job.shape.ny - y0);
    const int64_t stride = nx + 2 * guard;
    float *padded = static_cast<float *>(std::calloc(static_cast<size_t>(stride) * slab_rows, sizeof(float)));
    if (!padded) std::abort();
    bool any_update = false;
    for (int i = 0; i < job.n_views; ++i) any_update |= job.update[i];
    for (int z = 0; z < job.shape.nz; ++z) {
        PlaneRows plane{padded + guard, stride, z, y0, rows, nx, 0};
        for (int x0 = 0; x0 < nx; x0 += tile_columns) {
            const Tile tile{z, y0, rows, x0, smaller(tile_columns, nx - x0)};
            move_rows(job, tile, block, false);
            const bool occupied = update(job, tile, block);
            if (any_update) move_rows(job, tile, block, true);
            for (int row = 0; row < rows; ++row)
                std::memcpy(padded + guard + row * stride + x0, block.rows[row], sizeof(float) * tile.columns);
            if (!occupied) continue;
            plane.begin = smaller(plane.begin, x0);
            plane.end = x0 + tile.columns;
        }
        for (int i = 0; i < job.n_views && plane.begin < plane.end; ++i)
            if (job.project[i]) project(job.views[i], plane, projections[i]);
    }
    std::free(padded);
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{TOMOSHADOW_TEXT(TOMOSHADOW_ISA), line_of_sight, smart_pass};

}  // namespace tomoshadow::TOMOSHADOW_ISA
