// SMART: blocks found by MLOS, then multiplied by ratios and projected, pass by pass.
#pragma once

#include "halves.hpp"
#include "output.hpp"
#include "project.hpp"
#include "ratios.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int64_t block_size = smart_rows * block_columns;

inline void encode(const Block &block, float gain, uint16_t *values) {
    for (int row = 0; row < smart_rows; ++row)
        for (int k = 0; k < block_columns; k += lanes) {
            const Floats value = load<Floats>(block.rows[row] + k) * gain, most = Floats{} + largest_half;
            store_half_lanes(values + row * block_columns + k, value < most ? value : most);
        }
}

inline void decode(const uint16_t *values, float unit, Block &block) {
    for (int row = 0; row < smart_rows; ++row)
        for (int k = 0; k < block_columns; k += lanes)
            store(block.rows[row] + k, load_halves(values + row * block_columns + k) * unit);
}

inline void clear_overhang(Block &block, int rows, int columns) {
    for (int row = 0; row < smart_rows; ++row)
        for (int k = row < rows ? columns : 0; k < block_columns; ++k) block.rows[row][k] = 0.0f;
}

inline bool exceeds(const Block &block, int rows, float floor) {
    int32_t any = 0;
    for (int row = 0; row < rows; ++row)
        for (int k = 0; k < block_columns; ++k) any |= block.rows[row][k] > floor;
    return any != 0;
}

inline void take_power(Block &block, int rows, float exponent) {
    for (int row = 0; row < rows; ++row)
        for (int k = 0; k < block_columns; k += lanes)
            store(block.rows[row] + k, power(load<Floats>(block.rows[row] + k), exponent));
}

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
                if (!views_[i].nodes && projections[i].pixels)
                    image[z - first][i] = image_rows(views_[i], z, y0_, rows_, projections[i]);
            }
    }

    PlaneTaps taps[smart_planes][max_views];
    ImageRows image[smart_planes][max_views];

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

void smart_start(const SmartStart &job, int slab, KeepBlock keep, void *owner) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    const Projection nowhere[max_views] = {};
    TilePlanes planes(job.views, job.n_views, job.shape, y0, rows, 2);
    Block block;
    alignas(64) uint16_t values[block_size];
    for_tiles(job.shape, [&](int z, int x0) {
        const Tile tile{z, y0, rows, x0};
        if (z % smart_planes == 0 && x0 == 0) planes.set(z, nowhere);
        if (job.volume) {
            copy(job.volume, job.shape, tile, block);
        } else {
            const PlaneTaps *taps = planes.taps[z % smart_planes];
            if (!occupied(job.views, job.n_views, taps, tile)) return;
            sample_product(job.views, every_view, job.n_views, taps, tile, block);
            if (job.exponent != 1.0f) take_power(block, rows, job.exponent);
        }
        clear_overhang(block, rows, nx - x0);
        if (!exceeds(block, rows, job.floor)) return;
        encode(block, job.gain, values);
        keep(owner, {z, x0}, values);
    });
}

// Blocks come one after the other, but with so much work between them that processors do not fetch them in time.
inline void fetch(const uint16_t *row) {
    constexpr int blocks_ahead = 4;
    __builtin_prefetch(row + blocks_ahead * block_size, 1);
}

// Where the updated voxels of a block go: back to memory, and in single precision into the rows to be projected.
struct Updated {
    uint16_t *values;
    float *rows;
    void put(int row, int k, Floats value) const {
        const Floats most = Floats{} + largest_half;
        value = value < most ? value : most;
        store_half_lanes(values + row * block_columns + k, value);
        store(rows + row * PlaneRows::stride + k, value);
    }
};

#if defined(__AVX512BW__)

// All in registers, for views whose rows need one window per block.
template <int count>
inline void update_windows(const View *views, float gain, const int *chosen, const PlaneTaps *planes, const Tile &tile, const Updated &to) {
    Taps left[count], right[count];
    const RowTaps *rows[count];
    const int16_t *pixels[count];
    int64_t columns[count];
    for (int n = 0; n < count; ++n) {
        const View &view = views[chosen[n]];
        const double scale = view.scale[tile.z], start = scale * tile.x0 + view.shift_u[tile.z];
        const int first = static_cast<int>(start);
        left[n] = taps_from(first, start, scale);
        right[n] = taps_from(first, start + scale * lanes, scale);
        rows[n] = &planes[chosen[n]].rows;
        pixels[n] = view.pixels;
        columns[n] = view.columns;
    }
    float factor[(count + 1) / 2 + 1];
    for (int n = 0; n < count; n += 2)
        factor[n / 2] = views[chosen[n]].unit * sample_unit * (n + 1 < count ? views[chosen[n + 1]].unit * sample_unit : 1.0f);
    factor[0] *= gain;
    for (int row = 0; row < tile.rows; ++row) {
        Floats near = load_halves(to.values + row * block_columns), far = load_halves(to.values + row * block_columns + lanes);
        fetch(to.values + row * block_columns);
#pragma GCC unroll 4
        for (int n = 0; n < count; ++n) {
            const int16_t *above = pixels[n] + rows[n]->above[row], *below = above + columns[n];
            const Window window = blend(above, below, rows[n]->weight[row], left[n]);
            if (n % 2 == 0) {
                near *= factor[n / 2];
                far *= factor[n / 2];
            }
            near *= pick(window, left[n]);
            far *= pick(window, right[n]);
        }
        to.put(row, 0, near);
        to.put(row, lanes, far);
    }
}

inline bool fit_windows(const SmartPass &job, const int *chosen, int count, int z) {
    for (int n = 0; n < count; ++n) {
        const View &view = job.views[chosen[n]];
        if (view.nodes || view.scale[z] > max_shared_scale) return false;
    }
    return true;
}

#endif

// Multiply a block by the ratios of the chosen views.
inline void update(const SmartPass &job, const int *chosen, int count, const PlaneTaps *taps, const Tile &tile,
                   const Updated &to) {
#if defined(__AVX512BW__)
    if (count >= 1 && count <= 4 && fit_windows(job, chosen, count, tile.z)) {
        if (count == 4) return update_windows<4>(job.views, job.gain, chosen, taps, tile, to);
        if (count == 3) return update_windows<3>(job.views, job.gain, chosen, taps, tile, to);
        if (count == 2) return update_windows<2>(job.views, job.gain, chosen, taps, tile, to);
        if (count == 1) return update_windows<1>(job.views, job.gain, chosen, taps, tile, to);
    }
#endif
    Block ratio;
    if (count) sample_product(job.views, chosen, count, taps, tile, ratio);
    for (int row = 0; row < tile.rows; ++row) {
        fetch(to.values + row * block_columns);
        for (int k = 0; k < block_columns; k += lanes) {
            const Floats value = load_halves(to.values + row * block_columns + k);
            to.put(row, k, count ? value * (load<Floats>(ratio.rows[row] + k) * job.gain) : value);
        }
    }
}

// The blocks of one plane in a tile, side by side, with zeros where there are none and around.
class PaddedRows {
public:
    PaddedRows() : memory_(4 * PlaneRows::stride * smart_rows) {}
    float *voxels() const { return memory_.as<float>(); }
    float *at(int x) const { return voxels() + guard + x % smart_columns; }
    // Nothing shall remain of other planes where there is no block.
    void keep_only(uint32_t blocks) {
        for (int k = 0; k < smart_columns / block_columns; ++k)
            if ((filled_ & ~blocks) >> k & 1)
                for (int row = 0; row < smart_rows; ++row)
                    std::memset(at(k * block_columns) + row * PlaneRows::stride, 0, sizeof(float) * block_columns);
        filled_ = blocks;
    }

private:
    Memory memory_;
    uint32_t filled_ = 0;
};

// Project blocks first .. end - 1, all of one plane of a tile: together, where they touch.
inline void project_blocks(const SmartPass &job, const BlockList &blocks, int first, int end, const PlaneRows &plane,
                           const PlaneTaps *taps, const ImageRows *image, const Projection *projections) {
    for (int i = 0; i < job.n_views; ++i) {
        if (!projections[i].pixels) continue;
        for (int b = first, u = 0; b < end;) {
            const int begin = blocks.positions[b].x0;
            int next = begin;
            for (; b < end && blocks.positions[b].x0 == next; ++b) next += block_columns;
            const int last = smaller(next, job.shape.nx);
            if (job.views[i].nodes)
                project_nodes(job.views[i], plane, taps[i], begin, last, projections[i]);
            else
                u = project_rectified(job.views[i], plane, image[i], begin, last, u, projections[i]);
        }
    }
}

void smart_pass(const SmartPass &job, int slab, const BlockList &blocks, const Projection *projections) {
    const FlushSubnormals flush;
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    PaddedRows padded;
    TilePlanes planes(job.views, job.n_views, job.shape, y0, rows, 3);
    int chosen[max_views], count = 0, top = -1;
    for (int i = 0; i < job.n_views; ++i)
        if (job.update[i]) chosen[count++] = i;
    for (int first = 0, end = 0; first < blocks.count; first = end) {
        const int z = blocks.positions[first].z, left = blocks.positions[first].x0 / smart_columns * smart_columns;
        if (top != z / smart_planes) {
            top = z / smart_planes;
            planes.set(top * smart_planes, projections);
        }
        const PlaneTaps *taps = planes.taps[z % smart_planes];
        uint32_t present = 0;
        for (; end < blocks.count && blocks.positions[end].z == z; ++end) {
            const int x0 = blocks.positions[end].x0;
            if (x0 < left || x0 >= left + smart_columns) break;
            update(job, chosen, count, taps, {z, y0, rows, x0}, {blocks.values + end * block_size, padded.at(x0)});
            present |= 1u << (x0 - left) / block_columns;
        }
        padded.keep_only(present);
        const PlaneRows plane{padded.voxels(), z, y0, rows, left};
        project_blocks(job, blocks, first, end, plane, taps, planes.image[z % smart_planes], projections);
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
            decode(blocks.values + found * block_size, unit, block);
            staging.put(tile, block);
        }
        staging.write(shape, z, y0, volume);
    }
    finish_streams();
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
