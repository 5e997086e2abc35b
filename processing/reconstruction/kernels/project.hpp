// The way back: what the rows of a slab in one plane add to the image of a view.
#pragma once

#include "sample.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int guard = 64;  // zeros before and after a row of voxels

// Rows y0 .. y0 + rows - 1 of plane z, columns x0 .. x0 + smart_columns - 1, with zeros where there are no blocks and
// around.
struct PlaneRows {
    static constexpr int stride = smart_columns + 2 * guard;
    const float *voxels;  // of row y0, guard first
    int z, y0, rows, x0;
};

// Image rows that meet the rows of a slab. Row number t lies between rows t - 1 and t of the slab, whose shares it
// takes; rows -1 and `rows` are zero. Where image rows are no denser than rows of voxels, one at most lies
// between two of them: then each t has its image row, or the spare one and no shares.
struct ImageRows {
    static constexpr int most = static_cast<int>((smart_rows + 1) * max_step) + 2;
    bool one_each;
    int count;
    int64_t offset[most];  // from the first pixel of the projection
    int32_t below[most];
    float upper[most], lower[most];
};

inline ImageRows image_rows(const View &view, int z, int y0, int rows, const Projection &to) {
    const double scale = view.scale[z], step = 1.0 / scale, shift = view.shift_v[z];
    const int begin = larger(to.first_row, ceil_of(scale * (y0 - 1) + shift));
    const int end = smaller(to.first_row + to.rows, floor_of(scale * (y0 + rows) + shift) + 1);
    ImageRows image;
    image.one_each = step >= 1.0 && rows == smart_rows;
    image.count = 0;
    if (image.one_each) {
        image.count = rows + 1;
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
        image.below[t] = below;
        image.offset[t] = static_cast<int64_t>(v - to.first_row) * to.stride;
        image.lower[t] = static_cast<float>(position - below);
        image.upper[t] = 1.0f - image.lower[t];
    }
    return image;
}

// Where vectors of pixels, side by side, see a row of voxels: at first[n] + fraction[n] and on.
struct PixelPositions {
    static constexpr int most = 2 * (smart_columns / lanes + lanes);
    int32_t first[most];
    float fraction[most];
    // Image rows are no denser than rows of voxels.
    PixelPositions(double start, double step, int vectors) {
        for (int n = 0; n < vectors; n += lanes) {
            const Floats at = lane_numbers() * static_cast<float>(step * lanes) + static_cast<float>(start + n * step * lanes);
            const Ints whole = __builtin_convertvector(at, Ints);
            store(first + n, whole);
            store(fraction + n, at - __builtin_convertvector(whole, Floats));
        }
    }
};

// What a vector of pixels sees of a row of voxels, by permutation of two vectors; these start at a boundary between
// cache lines where they then reach far enough ...
struct Picked {
    int first;
    Ints left;
    Floats fraction;
    Picked(int at, const Floats &offsets, double step) {
        const int beyond = at % lanes;
        const bool aligned = beyond + step * (lanes - 1) + 2 < 2 * lanes;
        first = aligned ? at - beyond : at;
        left = __builtin_convertvector(offsets, Ints);
        fraction = offsets - __builtin_convertvector(left, Floats);
        left += aligned ? beyond : 0;
    }
    Floats of(const float *row) const {
        const FloatTaps taps{first, false, left, fraction};
        return interpolate(row, taps);
    }
};

// ... or where pixels are nearly as dense as voxels, so that pixel k lies between the voxels k and k + 2 of a window:
// each of three neighbours adds with the weight 1 - |distance|. Vectors of 16 would need a fourth, and permute well.
struct Weighted {
    int first;
    Floats weights[3];
    static bool fits(double step) { return lanes < 16 && (lanes - 1) * (step - 1.0) < 0.999; }
    Weighted(int first_voxel, Floats at, double) : first(first_voxel) {
        const Floats zero{}, one = zero + 1.0f, beyond = at - lane_numbers();
        const Floats inner = beyond < one ? one - beyond : zero, outer = beyond > one ? beyond - one : zero;
        weights[0] = inner;
        weights[1] = one - inner - outer;
        weights[2] = outer;
    }
    Floats of(const float *row) const {
        const float *window = row + first;
        const Floats near = weights[0] * load<Floats>(window);
        return multiply_add(weights[2], load<Floats>(window + 2), multiply_add(weights[1], load<Floats>(window + 1), near));
    }
};

// Add what some vectors of pixels, side by side, see of the slab, image row by image row. Each row of voxels is
// interpolated once.
template <int vectors, class Seen>
inline void add_columns(const float *voxels, const Seen *seen, const ImageRows &image, float *pixels) {
    Floats above[vectors] = {};
#pragma GCC unroll 8
    for (int t = 0; t < smart_rows; ++t, voxels += PlaneRows::stride) {
        float *to = pixels + image.offset[t];
        const Floats upper = Floats{} + image.upper[t], lower = Floats{} + image.lower[t];
#pragma GCC unroll 4
        for (int n = 0; n < vectors; ++n) {
            const Floats below = seen[n].of(voxels);
            store(to + n * lanes, load<Floats>(to + n * lanes) + upper * above[n] + lower * below);
            above[n] = below;
        }
    }
    float *to = pixels + image.offset[smart_rows];
    for (int n = 0; n < vectors; ++n)
        store(to + n * lanes, load<Floats>(to + n * lanes) + image.upper[smart_rows] * above[n]);
}

inline void add_to(float *pixels, float upper, Floats above, float lower, Floats below) {
    store(pixels, load<Floats>(pixels) + upper * above + lower * below);
}

inline void add_column(const float *voxels, const FloatTaps &taps, const ImageRows &image, float *pixels) {
    Floats above{}, below = interpolate(voxels, taps);
    for (int n = 0, row = 0; n < image.count; ++n) {
        for (; row < image.below[n]; ++row) {
            voxels += PlaneRows::stride;
            above = below;
            below = row + 1 < smart_rows ? interpolate(voxels, taps) : Floats{};
        }
        add_to(pixels + image.offset[n], image.upper[n], above, image.lower[n], below);
    }
}

template <class Seen>
inline int add_all_columns(const PlaneRows &plane, const ImageRows &image, double step, double origin, int u, int u_end,
                           const Projection &to) {
    const int vectors = larger(0, u_end - u + lanes - 1) / lanes;
    const PixelPositions positions(u * step + origin, step, vectors);
    const Floats steps = lane_numbers() * static_cast<float>(step);
    int n = 0;
    for (; n + 1 < vectors; n += 2, u += 2 * lanes) {
        const Seen seen[2] = {{positions.first[n], steps + positions.fraction[n], step},
                              {positions.first[n + 1], steps + positions.fraction[n + 1], step}};
        add_columns<2>(plane.voxels, seen, image, to.pixels + u);
    }
    if (n >= vectors) return u;
    const Seen seen{positions.first[n], steps + positions.fraction[n], step};
    add_columns<1>(plane.voxels, &seen, image, to.pixels + u);
    return u + lanes;
}

// Pixel-driven: every pixel adds the bilinear interpolation of the plane where its line of sight meets it, for
// columns begin .. end - 1. Rows of other slabs count as zero: each slab adds its own share. Returns the first pixel
// that is left for the next run of columns in the same rows, of which `first` is the pixel to start at.
inline int project_rectified(const View &view, const PlaneRows &plane, const ImageRows &image, int begin, int end, int first,
                             const Projection &to) {
    const double scale = view.scale[plane.z], step = 1.0 / scale, shift = view.shift_u[plane.z];
    const int u_begin = larger(first, larger(0, ceil_of(scale * (begin - 1) + shift)) / lanes * lanes);
    const int u_end = smaller(view.columns, floor_of(scale * end + shift) + 1);
    const double origin = guard - plane.x0 - shift * step;
    if (image.one_each)
        return Weighted::fits(step) ? add_all_columns<Weighted>(plane, image, step, origin, u_begin, u_end, to)
                                    : add_all_columns<Picked>(plane, image, step, origin, u_begin, u_end, to);
    int u = u_begin;
    for (; u < u_end; u += lanes) add_column(plane.voxels, float_taps(u * step + origin, step), image, to.pixels + u);
    return u;
}

// Voxel-driven, the adjoint of sampling: every voxel spreads its intensity, times the pixel area it covers, over
// the four pixels it is sampled from.
inline void project_nodes(const View &view, const PlaneRows &plane, const PlaneTaps &taps, int begin, int end,
                          const Projection &to) {
    const Clamp last(view);
    alignas(64) float u[block_columns], v[block_columns], area[block_columns];
    for (int row = 0; row < plane.rows; ++row) {
        for (int x0 = begin; x0 < end; x0 += block_columns) {
            const float *voxels = plane.voxels + row * PlaneRows::stride + guard + x0 - plane.x0;
            spread_line(taps.line(row, 0), view.spacing, x0, u);
            spread_line(taps.line(row, 1), view.spacing, x0, v);
            spread_line(taps.line(row, 2), view.spacing, x0, area);
            for (int k = 0; k < smaller(block_columns, end - x0); ++k) {
                if (voxels[k] == 0.0f) continue;
                const float at_u = Clamp::between(u[k], last.u), at_v = Clamp::between(v[k], last.v);
                const int iu = static_cast<int>(at_u), iv = static_cast<int>(at_v);
                const float fu = at_u - static_cast<float>(iu), fv = at_v - static_cast<float>(iv);
                const float value = voxels[k] * area[k], below = value * fv, above = value - below;
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
