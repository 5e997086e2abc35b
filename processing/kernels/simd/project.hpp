// The way back: what the blocks of a tile add to the image of a view.
#pragma once

#include "simd/rows.hpp"
#include "simd/sampling/sample.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int guard = 64;  // zeros before and after a row of voxels: whole blocks, and more than two vectors of pixels see
constexpr int plane_lanes = (smart_planes + lanes - 1) / lanes * lanes;

// Rows y0 .. y0 + smart_rows - 1 and columns x0 .. x0 + smart_columns - 1 of some planes, with zeros where there is no
// block and around. Bit n of `filled` tells of columns 32 n .. 32 n + 31 of a plane, guard included.
struct TileRows {
    static constexpr int stride = smart_columns + 2 * guard, plane_stride = smart_rows * stride;
    const RowVoxel *voxels;
    int z0, planes, y0, rows, x0;
    int32_t filled[smart_planes];
};

// Image rows that meet the rows of a slab in one plane. Row number t lies between rows t - 1 and t of the slab, whose
// shares it takes; rows -1 and `rows` are zero. Where image rows are no denser than rows of voxels, one at most lies
// between two of them: then each t has its image row, or the spare one and no shares.
struct ImageRows {
    static constexpr int most = static_cast<int>((smart_rows + 1) * max_scale) + 2;
    bool one_each;
    uint32_t changed;  // bit t: its image row is another one than in the plane before
    int count;
    int64_t offset[most];  // from the first pixel of the projection
    int32_t below[most];
    float upper[most], lower[most];
};

inline void image_rows(const View &view, int z, int y0, int rows, const Projection &to, ImageRows &image) {
    const double scale = view.scale[z], step = 1.0 / scale, shift = view.shift_v[z];
    const int begin = larger(to.first_row, ceil_of(scale * (y0 - 1) + shift));
    const int end = smaller(to.first_row + to.rows, floor_of(scale * (y0 + rows) + shift) + 1);
    image.one_each = step >= 1.0;
    image.count = 0;
    if (image.one_each) {
        image.count = smart_rows + 1;
        for (int t = 0; t < image.count; ++t) {
            image.offset[t] = static_cast<int64_t>(to.rows) * to.stride;
            image.upper[t] = image.lower[t] = 0.0f;
        }
    }
    for (int v = begin; v < end; ++v) {
        const double position = (v - shift) * step - y0 + 1;
        const int below = larger(0, static_cast<int>(position));
        if (below > rows) break;
        const int t = image.one_each ? below : image.count++;
        const auto lower = static_cast<float>(position - below);
        image.below[t] = below;
        image.offset[t] = static_cast<int64_t>(v - to.first_row) * to.stride;
        image.lower[t] = lower * (1.0f / voxel_unit);
        image.upper[t] = (1.0f - lower) * (1.0f / voxel_unit);
    }
}

inline uint32_t changes(const ImageRows &before, const ImageRows &after) {
    uint32_t changed = 0;
    for (int t = 0; t <= smart_rows; ++t) changed |= static_cast<uint32_t>(before.offset[t] != after.offset[t]) << t;
    return changed;
}

// Where the first pixel of a row is seen in the rows of each plane, guard included, and the next ones from there on.
struct PlaneSteps {
    alignas(64) float start[plane_lanes] = {}, step[plane_lanes] = {};
};

// Where vectors of pixels, side by side, begin in the rows of each plane; and whether they see any block of it.
template <int vectors>
struct PixelVectors {
    alignas(64) int32_t first[vectors][plane_lanes], sees[plane_lanes];
    alignas(64) float fraction[vectors][plane_lanes];
    PixelVectors(const TileRows &tile, const PlaneSteps &steps, int u) {
        const Ints none{}, last = none + (TileRows::stride - 1);
        for (int z = 0; z < plane_lanes; z += lanes) {
            const Floats step = load<Floats>(steps.step + z);
            Floats at = load<Floats>(steps.start + z) + step * static_cast<float>(u);
            Ints left = __builtin_convertvector(at, Ints);
            Ints right = __builtin_convertvector(at + step * static_cast<float>(vectors * lanes - 1), Ints) + 1;
            left = left > none ? left : none;
            left = left < last ? left : last;
            right = right > none ? right : none;
            right = right < last ? right : last;
            store(sees + z, (2 << right / block_columns) - (1 << left / block_columns));
            for (int n = 0; n < vectors; ++n, at += step * static_cast<float>(lanes)) {
                const Ints whole = __builtin_convertvector(at, Ints);
                store(first[n] + z, whole);
                store(fraction[n] + z, at - __builtin_convertvector(whole, Floats));
            }
        }
        for (int z = 0; z < tile.planes; ++z) sees[z] &= tile.filled[z];
    }
};

// Sums of vectors of pixels in smart_rows + 1 image rows, in registers.
template <int vectors>
struct Sums {
    Floats rows[smart_rows + 1][vectors] = {};
    [[gnu::always_inline]] void put(uint32_t which, const ImageRows &image, float *pixels) {
#pragma GCC unroll 16
        for (int t = 0; t <= smart_rows; ++t) {
            if (!(which >> t & 1)) continue;
            float *to = pixels + image.offset[t];
#pragma GCC unroll 4
            for (int n = 0; n < vectors; ++n) {
                store(to + n * lanes, load<Floats>(to + n * lanes) + rows[t][n]);
                rows[t][n] = Floats{};
            }
        }
    }
};

// The voxels that vectors of pixels see in one plane.
template <class Samples, int vectors>
class Windows {
public:
    [[gnu::always_inline]] Windows(const RowVoxel *plane, const PlaneSteps &steps, const PixelVectors<vectors> &at, int z) {
        const Floats offsets = lane_numbers() * steps.step[z];
#pragma GCC unroll 4
        for (int n = 0; n < vectors; ++n) {
            samples_[n] = Samples(offsets + all(at.fraction[n][z]));
            first_[n] = plane + at.first[n][z];
        }
    }
    [[gnu::always_inline]] Floats of(int row, int n) const { return samples_[n].of(first_[n] + row * TileRows::stride); }

private:
    Samples samples_[vectors];
    const RowVoxel *first_[vectors];
};

// Add what vectors of pixels, side by side, see of a tile. Neighbouring planes are seen in the same image rows, mostly:
// their sums remain in registers until that changes.
template <class Samples, int vectors>
inline void add_vectors(const TileRows &tile, const PlaneSteps &steps, const ImageRows *image, int u, float *pixels) {
    const PixelVectors<vectors> at(tile, steps, u);
    Sums<vectors> sums;
    int before = -1;
    uint32_t changed = 0;
    for (int z = 0; z < tile.planes; ++z) {
        changed |= image[z].changed;
        if (!at.sees[z]) continue;
        if (changed && before >= 0) sums.put(changed, image[before], pixels);
        before = z;
        changed = 0;
        const Windows<Samples, vectors> windows(tile.voxels + z * TileRows::plane_stride, steps, at, z);
#pragma GCC unroll 8
        for (int row = 0; row < smart_rows; ++row) {
            const Floats lower = all(image[z].lower[row]), upper = all(image[z].upper[row + 1]);
#pragma GCC unroll 4
            for (int n = 0; n < vectors; ++n) {
                const Floats seen = windows.of(row, n);
                sums.rows[row][n] = multiply_add(lower, seen, sums.rows[row][n]);
                sums.rows[row + 1][n] = multiply_add(upper, seen, sums.rows[row + 1][n]);
            }
        }
    }
    if (before >= 0) sums.put(~0u, image[before], pixels);
}

constexpr int vectors_at_once = 2;

template <class Samples>
inline void add_tile(const TileRows &tile, const PlaneSteps &steps, const ImageRows *image, int vectors, float *pixels) {
    int n = 0;
    for (; n + vectors_at_once <= vectors; n += vectors_at_once)
        add_vectors<Samples, vectors_at_once>(tile, steps, image, n * lanes, pixels + n * lanes);
    for (; n < vectors; ++n) add_vectors<Samples, 1>(tile, steps, image, n * lanes, pixels + n * lanes);
}

// The same where image rows are denser than rows of voxels.
inline void add_dense_rows(const TileRows &tile, const PlaneSteps &steps, const ImageRows *image, int u, float *pixels) {
    const PixelVectors<1> at(tile, steps, u);
    for (int z = 0; z < tile.planes; ++z) {
        if (!at.sees[z]) continue;
        const RowSamples samples(lane_numbers() * steps.step[z] + all(at.fraction[0][z]));
        const RowVoxel *window = tile.voxels + z * TileRows::plane_stride + at.first[0][z];
        Floats above{}, below = samples.of(window);
        for (int n = 0, row = 0; n < image[z].count; ++n) {
            for (; row < image[z].below[n]; ++row) {
                window += TileRows::stride;
                above = below;
                below = row + 1 < smart_rows ? samples.of(window) : Floats{};
            }
            float *to = pixels + image[z].offset[n];
            store(to, load<Floats>(to) + image[z].upper[n] * above + image[z].lower[n] * below);
        }
    }
}

// Pixel-driven: every pixel adds the bilinear interpolation of each plane where its line of sight meets it. Rows of other
// slabs and columns of other tiles count as zero: each adds its own share.
inline void project_rectified(const View &view, const TileRows &tile, const ImageRows *image, const Projection &to) {
    int u_begin = view.columns, u_end = 0;
    bool one_each = true, quick = true;
    for (int z = 0; z < tile.planes; ++z) {
        if (!tile.filled[z]) continue;
        const double scale = view.scale[tile.z0 + z], shift = view.shift_u[tile.z0 + z];
        const int begin = tile.x0 - guard + block_columns * __builtin_ctz(static_cast<uint32_t>(tile.filled[z]));
        const int end = tile.x0 - guard + block_columns * (32 - __builtin_clz(static_cast<uint32_t>(tile.filled[z])));
        u_begin = smaller(u_begin, larger(0, ceil_of(scale * (begin - 1) + shift)));
        u_end = larger(u_end, smaller(view.columns, floor_of(scale * end + shift) + 1));
        one_each = one_each && image[z].one_each;
        quick = quick && QuickRowSamples::fits(1.0 / scale);
    }
    u_begin = u_begin / lanes * lanes;
    PlaneSteps steps;
    for (int z = 0; z < tile.planes; ++z) {
        const double step = 1.0 / view.scale[tile.z0 + z];
        steps.step[z] = static_cast<float>(step);
        steps.start[z] = static_cast<float>((u_begin - view.shift_u[tile.z0 + z]) * step + guard - tile.x0);
    }
    const int vectors = larger(0, u_end - u_begin + lanes - 1) / lanes;
    float *pixels = to.pixels + u_begin;
    if (one_each && quick) return add_tile<QuickRowSamples>(tile, steps, image, vectors, pixels);
    if (one_each) return add_tile<RowSamples>(tile, steps, image, vectors, pixels);
    for (int n = 0; n < vectors; ++n) add_dense_rows(tile, steps, image, n * lanes, pixels + n * lanes);
}

// Voxel-driven, the adjoint of sampling: every voxel spreads its intensity, times the pixel area it covers, over
// the four pixels it is sampled from.
inline void project_nodes(const View &view, const TileRows &tile, int z, int nx, const PlaneTaps &taps, const Projection &to) {
    const Clamp last(view);
    alignas(64) float u[block_columns], v[block_columns], area[block_columns];
    for (int row = 0; row < tile.rows; ++row) {
        const RowVoxel *voxels = tile.voxels + z * TileRows::plane_stride + row * TileRows::stride + guard;
        for (int column = 0; column < smart_columns; column += block_columns, voxels += block_columns) {
            if (!(tile.filled[z] >> (guard + column) / block_columns & 1)) continue;
            const int x0 = tile.x0 + column;
            spread_line(taps.line(row, 0), view.spacing, x0, u);
            spread_line(taps.line(row, 1), view.spacing, x0, v);
            spread_line(taps.line(row, 2), view.spacing, x0, area);
            for (int k = 0; k < smaller(block_columns, nx - x0); ++k) {
                const float voxel = row_value(voxels[k]);
                if (voxel == 0.0f) continue;
                const float at_u = Clamp::between(u[k], last.u), at_v = Clamp::between(v[k], last.v);
                const int iu = static_cast<int>(at_u), iv = static_cast<int>(at_v);
                const float fu = at_u - static_cast<float>(iu), fv = at_v - static_cast<float>(iv);
                const float value = voxel * area[k] * (1.0f / voxel_unit), below = value * fv, above = value - below;
                float *pixels = to.pixels + static_cast<int64_t>(iv - to.first_row) * to.stride + iu;
                pixels[0] += above - above * fu;
                pixels[1] += above * fu;
                pixels[to.stride] += below - below * fu;
                pixels[to.stride + 1] += below * fu;
            }
        }
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
