// SMART: blocks found by MLOS, then multiplied by ratios and projected, pass by pass.
#pragma once

#include "output.hpp"
#include "project.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

void clear_overhang(Block &block, int rows, int columns) {
    for (int row = 0; row < smart_rows; ++row)
        for (int k = row < rows ? columns : 0; k < block_columns; ++k) block.rows[row][k] = 0.0f;
}

bool exceeds(const Block &block, int rows, float floor) {
    int32_t any = 0;
    for (int row = 0; row < rows; ++row)
        for (int k = 0; k < block_columns; ++k) any |= block.rows[row][k] > floor;
    return any != 0;
}

void smart_start(const SmartStart &job, int slab, KeepBlock keep, void *owner) {
    const FlushSubnormals flush;
    const int nx = job.shape.nx, y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    SlabTaps slab_taps(job.views, job.n_views, nx, y0, rows, 2);
    Block block;
    for (int z = 0; z < job.shape.nz; ++z) {
        slab_taps.set(z);
        for (int x0 = 0; x0 < nx; x0 += block_columns) {
            const Tile tile{z, y0, rows, x0};
            if (!occupied(job.views, job.n_views, slab_taps, tile)) continue;
            sample_product(job.views, every_view, job.n_views, slab_taps.taps, tile, block);
            clear_overhang(block, rows, nx - x0);
            if (exceeds(block, rows, job.floor)) keep(owner, {z, x0}, block.rows[0]);
        }
    }
}

constexpr int64_t block_size = smart_rows * block_columns;

// Multiply a block by the ratios of the chosen views.
inline void update(const SmartPass &job, const int *chosen, int count, const SlabTaps &slab, const Tile &tile,
                   float *values) {
    Block ratio;
    sample_product(job.views, chosen, count, slab.taps, tile, ratio);
    for (int row = 0; row < tile.rows; ++row, values += block_columns)
        for (int k = 0; k < block_columns; k += lanes)
            store(values + k, load<Floats>(values + k) * load<Floats>(ratio.rows[row] + k));
}

// The rows of a slab in one plane, with zeros where there are no blocks and around.
class PaddedRows {
public:
    explicit PaddedRows(int nx) : stride_(nx + 2 * guard + block_columns), memory_(stride_ * smart_rows * 4) {}
    float *voxels() const { return memory_.as<float>() + guard; }
    int64_t stride() const { return stride_; }
    void put(int x0, const float *values) const {
        for (int row = 0; row < smart_rows; ++row, values += block_columns)
            std::memcpy(voxels() + row * stride_ + x0, values, sizeof(float) * block_columns);
    }
    void clear(int x0) const {
        for (int row = 0; row < smart_rows; ++row)
            std::memset(voxels() + row * stride_ + x0, 0, sizeof(float) * block_columns);
    }

private:
    int64_t stride_;
    Memory memory_;
};

// Project blocks first .. end - 1, all of one plane: side by side, where they touch.
inline void project_blocks(const SmartPass &job, const SlabTaps &slab, const BlockList &blocks, int first, int end, int y0,
                           int rows, const PaddedRows &padded, const Projection *projections) {
    for (int b = first; b < end;) {
        const BlockPosition start = blocks.positions[b];
        int x_end = start.x0;
        for (; b < end && blocks.positions[b].x0 == x_end; ++b) x_end += block_columns;
        const PlaneRows run{padded.voxels(), padded.stride(), start.z, y0, rows, start.x0, smaller(x_end, job.shape.nx)};
        for (int i = 0; i < job.n_views; ++i)
            if (projections[i].pixels) project(job.views[i], run, slab.taps[i], projections[i]);
    }
}

void smart_pass(const SmartPass &job, int slab, const BlockList &blocks, const Projection *projections) {
    const FlushSubnormals flush;
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, job.shape.ny - y0);
    const PaddedRows padded(job.shape.nx);
    SlabTaps slab_taps(job.views, job.n_views, job.shape.nx, y0, rows, 3);
    int chosen[max_views], count = 0;
    for (int i = 0; i < job.n_views; ++i)
        if (job.update[i]) chosen[count++] = i;
    for (int first = 0, end = 0; first < blocks.count; first = end) {
        const int z = blocks.positions[first].z;
        slab_taps.set(z);
        for (end = first; end < blocks.count && blocks.positions[end].z == z; ++end) {
            const int x0 = blocks.positions[end].x0;
            float *values = blocks.values + end * block_size;
            if (count) update(job, chosen, count, slab_taps, {z, y0, rows, x0}, values);
            padded.put(x0, values);
        }
        project_blocks(job, slab_taps, blocks, first, end, y0, rows, padded, projections);
        for (int b = first; b < end; ++b) padded.clear(blocks.positions[b].x0);
    }
}

void write_blocks(const Shape &shape, int slab, const BlockList &blocks, Format format, void *volume) {
    const int y0 = slab * smart_rows, rows = smaller(smart_rows, shape.ny - y0);
    Staging staging(format, shape.nx, rows);
    Block block;
    int b = 0;
    for (int z = 0; z < shape.nz; ++z) {
        for (int x0 = 0; x0 < shape.nx; x0 += block_columns) {
            const Tile tile{z, y0, rows, x0};
            if (b == blocks.count || blocks.positions[b].z != z || blocks.positions[b].x0 != x0) {
                staging.put_zeros(tile);
                continue;
            }
            std::memcpy(block.rows, blocks.values + b++ * block_size, sizeof(float) * block_size);
            staging.put(tile, block);
        }
        staging.write(shape, z, y0, rows, volume);
    }
    finish_streams();
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
