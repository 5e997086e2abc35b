// SMART: blocks are multiplied by ratios, then projected, pass by pass.
#pragma once

#include "simd/project.hpp"
#include "simd/sight.hpp"
#include "simd/tile_planes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Blocks come one after the other, but with so much work between them that processors do not fetch them in time.
inline void fetch(const uint16_t *row) {
    constexpr int blocks_ahead = 8;
    __builtin_prefetch(row + blocks_ahead * BlockList::size, 1);
}

// Where the updated voxels of a block go: back to memory, and into the rows to be projected.
struct Updated {
    Voxel *voxels;
    RowVoxel *rows;
    [[gnu::always_inline]] void put(int row, Floats (&values)[parts]) const {
        for (int n = 0; n < parts; ++n) values[n] = limited(values[n]);
        const RowWords words(values);
        words.store(voxels + row * block_columns);
        store_row(rows + row * TileRows::stride, values, words);
    }
};

// Multiply a block by the ratios of the chosen views: all of them in SMART, one in MART.
inline void update(const Together &chosen, const Tile &tile, float gain, const Updated &to) {
    const auto multiply = [&](int row, Floats (&ratios)[parts]) __attribute__((always_inline)) {
        Voxel *voxels = to.voxels + row * block_columns;
        fetch(voxels);
        for (int part = 0; part < parts; ++part) ratios[part] *= load_voxels(voxels + part * lanes);
        to.put(row, ratios);
    };
    if (chosen.count) return see_product(chosen, tile, gain, multiply);
    for (int row = 0; row < tile.rows; ++row) {
        Floats ratios[parts];
        for (Floats &ratio : ratios) ratio = all(1.0f);
        multiply(row, ratios);
    }
}

// The blocks of a tile, to be projected.
class TileBlocks {
public:
    TileBlocks(int y0, int rows) : memory_(sizeof(RowVoxel) * TileRows::plane_stride * smart_planes) {
        tile_.voxels = memory_.as<RowVoxel>();
        tile_.y0 = y0;
        tile_.rows = rows;
    }
    // The tile that a block lies in; nothing of it is there yet.
    void begin(const BlockPosition &block, const Shape &shape) {
        tile_.z0 = block.z / smart_planes * smart_planes;
        tile_.x0 = block.x0 / smart_columns * smart_columns;
        tile_.planes = smaller(smart_planes, shape.nz - tile_.z0);
        for (int z = 0; z < smart_planes; ++z) {
            stale_[z] = tile_.filled[z];
            tile_.filled[z] = 0;
        }
    }
    bool contains(const BlockPosition &block) const {
        return block.z >= tile_.z0 && block.z < tile_.z0 + smart_planes && block.x0 >= tile_.x0 &&
               block.x0 < tile_.x0 + smart_columns;
    }
    // Where the voxels of a block belong.
    RowVoxel *add(const BlockPosition &block) {
        const int z = block.z - tile_.z0, column = guard + block.x0 - tile_.x0;
        tile_.filled[z] |= 1 << column / block_columns;
        return memory_.as<RowVoxel>() + z * TileRows::plane_stride + column;
    }
    // Nothing remains of the tile before.
    const TileRows &complete() {
        for (int z = 0; z < smart_planes; ++z)
            for (int32_t stale = stale_[z] & ~tile_.filled[z]; stale; stale &= stale - 1) clear(z, __builtin_ctz(static_cast<uint32_t>(stale)));
        return tile_;
    }

private:
    void clear(int z, int block) const {
        RowVoxel *voxels = memory_.as<RowVoxel>() + z * TileRows::plane_stride + block * block_columns;
        for (int row = 0; row < smart_rows; ++row, voxels += TileRows::stride)
            std::memset(voxels, 0, sizeof(RowVoxel) * block_columns);
    }

    Memory memory_;
    TileRows tile_{};
    int32_t stale_[smart_planes];
};

inline void project(const SmartPass &job, const TileRows &tile, const TilePlanes &planes, const Projection *projections) {
    for (int i = 0; i < job.n_views; ++i) {
        if (!projections[i].pixels) continue;
        if (!job.views[i].nodes)
            project_rectified(job.views[i], tile, planes.image[i], projections[i]);
        else
            for (int z = 0; z < tile.planes; ++z)
                project_nodes(job.views[i], tile, z, job.shape.nx, planes.taps[z][i], projections[i]);
    }
}

void smart_pass(const SmartPass &job, int slab, const BlockList &blocks, const Projection *projections) {
    const FlushSubnormals flush;
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    TileBlocks tile(y0, rows);
    TilePlanes planes(job.views, job.n_views, job.shape, y0, rows, 3);
    const View *views = job.views + job.first_update;
    const bool rectified = all_rectified(views, job.n_updates);
    int top = -1;
    for (int b = 0; b < blocks.count;) {
        tile.begin(blocks.positions[b], job.shape);
        const int z0 = blocks.positions[b].z / smart_planes * smart_planes;
        if (top != z0) planes.set(top = z0, projections);
        for (; b < blocks.count && tile.contains(blocks.positions[b]); ++b) {
            const BlockPosition &at = blocks.positions[b];
            const Together chosen{views, planes.taps[at.z - z0] + job.first_update, job.n_updates, rectified};
            update(chosen, {at.z, y0, rows, at.x0}, job.gain, {blocks.voxels(b), tile.add(at)});
        }
        project(job, tile.complete(), planes, projections);
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
