// Line of sight, and the list of all kernels. This file is compiled once per instruction set; all it defines lives in the
// namespace of that set and calls no inline function of the standard library, so that the linker cannot hand
// code for a newer processor to an older one.
#include "host/instruction_set.hpp"
#include "simd/output.hpp"
#include "simd/preprocess.hpp"
#include "simd/ratios.hpp"
#include "simd/resample.hpp"
#include "simd/sight.hpp"
#include "simd/smart.hpp"

#define TOMOSHADOW_TEXT_(name) #name
#define TOMOSHADOW_TEXT(name) TOMOSHADOW_TEXT_(name)

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

void line_of_sight(const LineOfSight &job, int slab) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, y0 = slab * sight_rows, rows = smaller(sight_rows, job.shape.ny - y0);
    const Exposures exposure{job.views, job.n_views, 1, job.method};
    PlaneStack planes(job.views, job.n_views, nx, job.first_row + y0, rows);
    Staging banks[2] = {{job.format, nx, rows, planes.depth()}, {job.format, nx, rows, planes.depth()}};
    const Seen seen(planes.depth(), nx);
    Drain drain;
    const int64_t piece = static_cast<int64_t>(bytes_of(job.format)) * rows * block_columns;
    Block block;
    const auto take = [&](int row, const Floats (&values)[parts]) { block.set(row, values); };
    for (int z0 = 0, bank = 0; z0 < job.shape.nz; z0 += planes.depth(), bank = 1 - bank) {
        const int z_end = smaller(z0 + planes.depth(), job.shape.nz);
        planes.set(z0, z_end);
        for (int z = z0; z < z_end; ++z) seen.look(exposure, planes.plane(z - z0), z - z0, {z, job.first_row + y0, rows, 0}, nx);
        for (int x0 = 0; x0 < nx; x0 += block_columns)
            for (int z = z0; z < z_end; ++z) {
                const Tile tile{z, job.first_row + y0, rows, x0};
                if (const uint32_t exposures = seen.exposures(z - z0, x0)) {
                    see(exposure, exposures, planes.plane(z - z0), tile, take);
                    banks[bank].put(tile, block, z - z0);
                } else {
                    banks[bank].put_zeros(tile, z - z0);
                }
                drain.write(piece);
            }
        drain.finish();
        drain = Drain(banks[bank], job.shape, z0, z_end, y0, job.volume);
    }
    drain.finish();
    finish_streams();
}

inline void add_to_volume(const SumOfSight &job, const Tile &tile, const Block &sum) {
    for (int row = 0; row < tile.rows; ++row) {
        float *voxels = job.volume + (static_cast<int64_t>(tile.z) * job.shape.ny + tile.y0 + row) * job.shape.nx + tile.x0;
        for (int k = 0; k < smaller(block_columns, job.shape.nx - tile.x0); ++k) voxels[k] += sum.rows[row][k];
    }
}

// The sums of a few blocks of columns, through all planes of a stack, stay in the cache while exposure after exposure
// is added; a few exposures at a time share what is known of the geometry.
struct SumTile {
    static constexpr int blocks = 16;
    int z0, depth, x0, x_end;
};

inline void add_exposures(const SumOfSight &job, const PlaneStack &planes, const Seen &seen, const SumTile &over, int y0, int rows,
                          Block *sums) {
    for (int n = 0; n < job.n_exposures; n += most_at_once) {
        const Exposures some{job.views + static_cast<int64_t>(n) * job.n_views, job.n_views,
                             smaller(most_at_once, job.n_exposures - n), job.method};
        for (int plane = 0; plane < over.depth; ++plane)
            seen.look(some, planes.plane(plane), plane, {over.z0 + plane, y0, rows, over.x0}, over.x_end);
        Block *sum = sums;
        for (int x0 = over.x0; x0 < over.x_end; x0 += block_columns)
            for (int plane = 0; plane < over.depth; ++plane, ++sum)
                see(some, seen.exposures(plane, x0), planes.plane(plane), {over.z0 + plane, y0, rows, x0},
                    [&](int row, const Floats (&values)[parts]) {
                        for (int part = 0; part < parts; ++part) sum->vectors[row][part] += values[part];
                    });
    }
}

void sum_of_sight(const SumOfSight &job, int slab) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, y0 = slab * sight_rows, rows = smaller(sight_rows, job.shape.ny - y0);
    PlaneStack planes(job.views, job.n_views, nx, y0, rows);
    const Seen seen(planes.depth(), nx);
    const int64_t bytes = static_cast<int64_t>(sizeof(Block)) * planes.depth() * SumTile::blocks;
    const Memory sums(bytes);
    for (int z0 = 0; z0 < job.shape.nz; z0 += planes.depth()) {
        const int depth = smaller(planes.depth(), job.shape.nz - z0);
        planes.set(z0, z0 + depth);
        for (int first = 0; first < nx; first += SumTile::blocks * block_columns) {
            const SumTile over{z0, depth, first, smaller(nx, first + SumTile::blocks * block_columns)};
            std::memset(sums.as<void>(), 0, static_cast<size_t>(bytes));
            add_exposures(job, planes, seen, over, y0, rows, sums.as<Block>());
            const Block *sum = sums.as<Block>();
            for (int x0 = over.x0; x0 < over.x_end; x0 += block_columns)
                for (int plane = 0; plane < depth; ++plane) add_to_volume(job, {z0 + plane, y0, rows, x0}, *sum++);
        }
    }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels{
    TOMOSHADOW_TEXT(TOMOSHADOW_ISA), line_of_sight, sum_of_sight, smart_start, smart_pass, write_blocks, correct,
    resample, brightest, quantise, find_filled, row_minima, column_minima, row_means, subtract_veil};

}  // namespace tomoshadow::TOMOSHADOW_ISA
