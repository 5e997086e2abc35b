// Line of sight, and the list of all kernels. This file is compiled once per instruction set; all it defines lives in the
// namespace of that set and calls no inline function of the standard library, so that the linker cannot hand
// code for a newer processor to an older one.
#include "instruction_set.hpp"
#include "output.hpp"
#include "preprocess.hpp"
#include "ratios.hpp"
#include "resample.hpp"
#include "smart.hpp"

#define TOMOSHADOW_TEXT_(name) #name
#define TOMOSHADOW_TEXT(name) TOMOSHADOW_TEXT_(name)

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

inline void see(const View *views, int n_views, Method method, const SlabTaps &slab, const Tile &tile, Block &block) {
    if (method == Method::minimum)
        sample_minimum(views, n_views, slab.taps, tile, block);
    else
        sample_product(views, every_view, n_views, slab.taps, tile, block);
    if (method == Method::geometric_mean) take_root(block, tile.rows, n_views);
}

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
            see(job.views, job.n_views, job.method, slab_taps, tile, block);
            staging.put(tile, block);
        }
        staging.write(job.shape, z, y0, rows, job.volume);
    }
    finish_streams();
}

inline void add(Block &sum, const Block &block, int rows) {
    for (int row = 0; row < rows; ++row)
        for (int k = 0; k < block_columns; k += lanes)
            store(sum.rows[row] + k, load<Floats>(sum.rows[row] + k) + load<Floats>(block.rows[row] + k));
}

inline void add_to_volume(const SumOfSight &job, const Tile &tile, const Block &sum) {
    for (int row = 0; row < tile.rows; ++row) {
        float *voxels = job.volume + (static_cast<int64_t>(tile.z) * job.shape.ny + tile.y0 + row) * job.shape.nx + tile.x0;
        for (int k = 0; k < smaller(block_columns, job.shape.nx - tile.x0); ++k) voxels[k] += sum.rows[row][k];
    }
}

// A few planes at a time, whose sums stay in the cache while exposure after exposure is added.
void sum_of_sight(const SumOfSight &job, int slab) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, nz = job.shape.nz, y0 = slab * sight_rows, rows = smaller(sight_rows, job.shape.ny - y0);
    constexpr int planes = 16;
    const int across = (nx + block_columns - 1) / block_columns;
    const Memory memory(static_cast<int64_t>(sizeof(Block)) * planes * across);
    Block *const sums = memory.as<Block>();
    Block block;
    for (int z0 = 0; z0 < nz; z0 += planes) {
        const int z_end = smaller(z0 + planes, nz);
        std::memset(static_cast<void *>(sums), 0, sizeof(Block) * static_cast<size_t>(planes * across));
        for (int n = 0; n < job.n_exposures; ++n) {
            const View *views = job.views + static_cast<int64_t>(n) * job.n_views;
            SlabTaps slab_taps(views, job.n_views, nx, y0, rows, 2);
            for (int z = z0; z < z_end; ++z) {
                slab_taps.set(z);
                for (int column = 0; column < across; ++column) {
                    const Tile tile{z, y0, rows, column * block_columns};
                    if (!occupied(views, job.n_views, slab_taps, tile)) continue;
                    see(views, job.n_views, job.method, slab_taps, tile, block);
                    add(sums[(z - z0) * across + column], block, rows);
                }
            }
        }
        for (int z = z0; z < z_end; ++z)
            for (int column = 0; column < across; ++column)
                add_to_volume(job, {z, y0, rows, column * block_columns}, sums[(z - z0) * across + column]);
    }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{
    TOMOSHADOW_TEXT(TOMOSHADOW_ISA), line_of_sight, sum_of_sight, smart_start, smart_pass, write_blocks, correct, resample,
    brightest, quantise, row_minima, column_minima, row_means, subtract_veil};

}  // namespace tomoshadow::TOMOSHADOW_ISA
