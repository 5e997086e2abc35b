// Line of sight: volumes of one exposure, and sums of many.
#pragma once

#include "simd/output.hpp"
#include "simd/sight.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Columns [x0, x_end) of a slab in the planes of a stack.
struct Stack {
    int z0, depth, y0, rows, x0, x_end;
    Stack columns(int first, int end) const { return {z0, depth, y0, rows, first, smaller(end, x_end)}; }
    // All planes of a column of blocks come before the next one: they see almost the same pixels.
    template <class Visit>
    [[gnu::always_inline]] void for_tiles(const Visit &visit) const {
        for (int x = x0; x < x_end; x += block_columns)
            for (int plane = 0; plane < depth; ++plane) visit(plane, Tile{z0 + plane, y0, rows, x});
    }
};

// Where views see the rows of a slab, one stack of planes after the other.
class SlabSight {
public:
    const int y0, rows;  // y0: in the volume, which may be a part of the grid
    SlabSight(const View *views, int n_views, const Shape &shape, const Corner &first, int slab)
        : y0(slab * sight_rows),
          rows(smaller(sight_rows, shape.ny - y0)),
          whole_{0, shape.nz, first.row + y0, rows, first.column, first.column + shape.nx},
          planes_(views, n_views, whole_.x_end, whole_.y0, rows),
          seen_(planes_.depth(), whole_.x_end) {}

    int depth() const { return planes_.depth(); }
    template <class Visit>
    [[gnu::always_inline]] void for_stacks(const Visit &visit) {
        for (int z = 0; z < whole_.depth; z += depth()) {
            Stack stack = whole_;
            stack.z0 = z;
            stack.depth = smaller(depth(), whole_.depth - z);
            planes_.set(z, z + stack.depth);
            visit(stack);
        }
    }
    // Look up which exposures may see something in the tiles of a stack.
    void look(const Exposures &from, const Stack &stack) const {
        for (int plane = 0; plane < stack.depth; ++plane)
            seen_.look(from, planes_.plane(plane), plane, {stack.z0 + plane, stack.y0, stack.rows, stack.x0}, stack.x_end);
    }
    // Hand every row of a tile in every such exposure to take(row, values); returns whether there was one.
    template <class Take>
    [[gnu::always_inline]] bool see(const Exposures &from, int plane, const Tile &tile, const Take &take) const {
        const uint32_t exposures = seen_.exposures(plane, tile.x0);
        if (exposures) tomoshadow::TOMOSHADOW_ISA::see(from, exposures, planes_.plane(plane), tile, take);
        return exposures;
    }

private:
    const Stack whole_;
    PlaneStack planes_;
    const Seen seen_;
};

void line_of_sight(const LineOfSight &job, int number) {
    const FlushSubnormals flush;
    const Exposures exposure{job.views, job.n_views, 1, job.method};
    SlabSight slab(job.views, job.n_views, job.shape, job.first, number);
    const int nx = job.shape.nx, x0 = job.first.column;
    Staging banks[2] = {{job.format, nx, slab.rows, slab.depth(), x0}, {job.format, nx, slab.rows, slab.depth(), x0}};
    Drain drain;
    const int64_t piece = static_cast<int64_t>(bytes_of(job.format)) * slab.rows * block_columns;
    Block block;
    const auto take = [&](int row, const Floats (&values)[parts]) { block.set(row, values); };
    int bank = 0;
    slab.for_stacks([&](const Stack &stack) {
        Staging &staging = banks[bank];
        slab.look(exposure, stack);
        stack.for_tiles([&](int plane, const Tile &tile) {
            if (slab.see(exposure, plane, tile, take))
                staging.put(tile, block, plane);
            else
                staging.put_zeros(tile, plane);
            drain.write(piece);
        });
        drain.finish();
        drain = Drain(staging, job.shape, stack.z0, stack.z0 + stack.depth, slab.y0, job.volume);
        bank = 1 - bank;
    });
    drain.finish();
    finish_streams();
}

inline void put_in_volume(const SumOfSight &job, int y0, const Tile &tile, const Block &sum) {
    const int x0 = tile.x0 - job.first.column;
    for (int row = 0; row < tile.rows; ++row) {
        float *voxels = job.volume + (static_cast<int64_t>(tile.z) * job.shape.ny + y0 + row) * job.shape.nx + x0;
        const int columns = smaller(block_columns, job.shape.nx - x0);
        const float count = static_cast<float>(job.n_exposures);
        if (job.mean)
            for (int k = 0; k < columns; ++k) voxels[k] = sum.rows[row][k] / count;
        else
            for (int k = 0; k < columns; ++k) voxels[k] += sum.rows[row][k];
    }
}

// A few exposures at a time share what is known of the geometry.
inline void add_exposures(const SumOfSight &job, const SlabSight &slab, const Stack &stack, Block *sums) {
    for (int n = 0; n < job.n_exposures; n += most_at_once) {
        const Exposures some{job.views + static_cast<int64_t>(n) * job.n_views, job.n_views,
                             smaller(most_at_once, job.n_exposures - n), job.method};
        slab.look(some, stack);
        Block *sum = sums;
        stack.for_tiles([&](int plane, const Tile &tile) {
            slab.see(some, plane, tile, [&](int row, const Floats (&values)[parts]) {
                for (int part = 0; part < parts; ++part) sum->vectors[row][part] += values[part];
            });
            ++sum;
        });
    }
}

// The sums of a few blocks of columns, through all planes of a stack, stay in the cache while exposure after exposure
// is added.
void sum_of_sight(const SumOfSight &job, int number) {
    constexpr int columns_at_once = 16 * block_columns;
    const FlushSubnormals flush;
    SlabSight slab(job.views, job.n_views, job.shape, job.first, number);
    const int64_t bytes = static_cast<int64_t>(sizeof(Block)) * slab.depth() * (columns_at_once / block_columns);
    const Memory sums(bytes);
    slab.for_stacks([&](const Stack &stack) {
        for (int x0 = stack.x0; x0 < stack.x_end; x0 += columns_at_once) {
            const Stack part = stack.columns(x0, x0 + columns_at_once);
            std::memset(sums.as<void>(), 0, static_cast<size_t>(bytes));
            add_exposures(job, slab, part, sums.as<Block>());
            const Block *sum = sums.as<Block>();
            part.for_tiles([&](int, const Tile &tile) { put_in_volume(job, slab.y0, tile, *sum++); });
        }
    });
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
