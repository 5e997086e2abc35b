// SMART: blocks found by MLOS, then multiplied by ratios and projected, pass by pass.
#pragma once

#include "simd/output.hpp"
#include "simd/project.hpp"
#include "simd/ratios.hpp"
#include "simd/sight.hpp"

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
    NewBlock(const SmartStart &job, const Tile &tile, Voxel *voxels)
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
    const SmartStart &job_;
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

// Visit the blocks of a slab in the order of BlockList.
template <class Visit>
inline void for_tiles(const Shape &shape, Visit visit) {
    for (int z0 = 0; z0 < shape.nz; z0 += smart_planes)
        for (int left = 0; left < shape.nx; left += smart_columns)
            for (int z = z0; z < smaller(z0 + smart_planes, shape.nz); ++z)
                for (int x0 = left; x0 < smaller(left + smart_columns, shape.nx); x0 += block_columns) visit(z, x0);
}

void smart_start(const SmartStart &job, int slab, const NewBlocks &blocks) {
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
