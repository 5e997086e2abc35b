// Blocks of a volume that are not empty: found, and written back.
#pragma once

#include "simd/output.hpp"
#include "simd/ratios.hpp"
#include "simd/sight.hpp"
#include "simd/tile_planes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

inline void decode(const Voxel *voxels, float unit, Block &block) {
    for (int row = 0; row < smart_rows; ++row)
        for (int k = 0; k < block_columns; k += lanes)
            store(block.rows[row] + k, load_voxels(voxels + row * block_columns + k) * (unit / voxel_unit));
}

// Makes a block of rows of intensities.
class NewBlock {
public:
    NewBlock(const BlockSearch &job, const Tile &tile, Voxel *voxels)
        : job_(job), columns_(job.shape.nx - tile.x0), voxels_(voxels) {
        if (tile.rows < smart_rows) std::memset(voxels, 0, sizeof(Voxel) * BlockList::size);
    }
    [[gnu::always_inline]] void put(int row, const Floats (&values)[parts]) {
        Floats kept[parts];
#pragma GCC unroll 8
        for (int part = 0; part < parts; ++part) {
            const Ints inside = __builtin_convertvector(lane_numbers() + static_cast<float>(part * lanes), Ints) < columns_;
            kept[part] = same_bits<Floats>(same_bits<Ints>(values[part]) & inside);
            if (job_.exponent != 1.0f) kept[part] = power(kept[part], job_.exponent);
            greatest_ = greatest_ > kept[part] ? greatest_ : kept[part];
            kept[part] = limited(kept[part] * (job_.gain * voxel_unit));
        }
        RowWords(kept).store(voxels_ + row * block_columns);
    }
    // Whether any voxel exceeds the floor.
    bool filled() const {
        int32_t any = 0;
        for (int k = 0; k < lanes; ++k) any |= greatest_[k] > job_.floor;
        return any != 0;
    }

private:
    const BlockSearch &job_;
    int32_t columns_;
    Voxel *voxels_;
    Floats greatest_{};
};

// Read a volume where a view would be sampled.
inline void copy(const float *volume, const Shape &shape, const Tile &tile, Block &block) {
    const int columns = smaller(block_columns, shape.nx - tile.x0);
    for (int row = 0; row < tile.rows; ++row)
        std::memcpy(block.rows[row], volume + (static_cast<int64_t>(tile.z) * shape.ny + tile.y0 + row) * shape.nx + tile.x0,
                    sizeof(float) * static_cast<size_t>(columns));
}

// Visit the blocks of a slab in the order of BlockList.
template <class Visit>
inline void for_tiles(const Shape &shape, Visit visit) {
    for (int z0 = 0; z0 < shape.nz; z0 += smart_planes)
        for (int left = 0; left < shape.nx; left += smart_columns)
            for (int z = z0; z < smaller(z0 + smart_planes, shape.nz); ++z)
                for (int x0 = left; x0 < smaller(left + smart_columns, shape.nx); x0 += block_columns) visit(z, x0);
}

void find_blocks(const BlockSearch &job, int slab, const NewBlocks &blocks) {
    const FlushSubnormals flush;
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    const Projection nowhere[max_views] = {};
    TilePlanes planes(job.views, job.n_views, job.shape, y0, rows, 2);
    const Exposures exposure{job.views, job.n_views, 1, Method::product};
    const Seen seen(smart_planes, job.shape.nx);
    const bool rectified = all_rectified(job.views, job.n_views);
    Block copied;
    for_tiles(job.shape, [&](int z, int x0) {
        const Tile tile{z, y0, rows, x0};
        if (z % smart_planes == 0 && x0 == 0) {
            planes.set(z, nowhere);
            for (int k = z; k < smaller(z + smart_planes, job.shape.nz); ++k)
                seen.look(exposure, planes.taps[k - z], k - z, {k, y0, rows, 0}, job.shape.nx);
        }
        const PlaneTaps *taps = planes.taps[z % smart_planes];
        if (!job.volume && !seen.exposures(z % smart_planes, x0)) return;
        NewBlock block(job, tile, blocks.next(blocks.owner));
        if (job.volume) {
            copy(job.volume, job.shape, tile, copied);
            for (int row = 0; row < rows; ++row) block.put(row, copied.vectors[row]);
        } else {
            const auto put = [&](int row, const Floats (&values)[parts]) __attribute__((always_inline)) { block.put(row, values); };
            see_product({job.views, taps, job.n_views, rectified}, tile, 1.0f, put);
        }
        if (block.filled()) blocks.keep(blocks.owner, {z, x0});
    });
}

// Blocks of a tile's planes by position, -1 where there is none.
class BlockIndex {
public:
    explicit BlockIndex(int nx) : across_(nx / block_columns + 1), memory_(4 * across_ * smart_planes) {}
    int &at(int z, int x0) const { return memory_.as<int>()[z % smart_planes * across_ + x0 / block_columns]; }
    void clear() const { std::memset(memory_.as<int>(), -1, sizeof(int) * static_cast<size_t>(across_) * smart_planes); }

private:
    int across_;
    Memory memory_;
};

void write_blocks(const Shape &shape, int slab, const BlockList &blocks, float unit, Format format, void *volume) {
    const FlushSubnormals flush;
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, shape.ny - y0);
    Staging staging(format, shape.nx, rows);
    BlockIndex index(shape.nx);
    Block block;
    for (int z = 0, b = 0; z < shape.nz; ++z) {
        if (z % smart_planes == 0) {
            index.clear();
            for (; b < blocks.count && blocks.positions[b].z < z + smart_planes; ++b)
                index.at(blocks.positions[b].z, blocks.positions[b].x0) = b;
        }
        for (int x0 = 0; x0 < shape.nx; x0 += block_columns) {
            const Tile tile{z, y0, rows, x0};
            const int found = index.at(z, x0);
            if (found < 0) {
                staging.put_zeros(tile);
                continue;
            }
            decode(blocks.voxels(found), unit, block);
            staging.put(tile, block);
        }
        staging.write(shape, z, y0, volume);
    }
    finish_streams();
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
