// Opaque discs, fitted to transmissions by coordinate descent. The logarithm of the transmission of all
// discs is kept up to date while discs change, so that a sweep costs a few small windows per disc and view. A disc's
// profile is interpolated from a table once per view; pixels then only look it up.
#pragma once

#include "job.hpp"
#include "simd/lanes.hpp"
#include "simd/ratios.hpp"
#include "simd/sighting.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// A disc as a view sees it. Pixels at a distance d from its centre lie at d^2 * nodes_per_px2 - inner_nodes of its profile.
struct SeenDisc {
    Sighting at;
    double reach_px, growth_unit, pull_unit;  // of the profile, in px and voxels
    float nodes_per_px2, inner_nodes;
    int top, bottom;
    bool empty;
    DiscProfile profile;
};

// Pixels per voxel across the line of sight: by the area that a square across it is seen as.
inline double image_scale(const Sighting &at) {
    double uu = 0, uv = 0, vv = 0;
    for (int i = 0; i < 3; ++i) {
        uu += at.along_u[i] * at.along_u[i];
        uv += at.along_u[i] * at.along_v[i];
        vv += at.along_v[i] * at.along_v[i];
    }
    return __builtin_sqrt(__builtin_sqrt(uu * vv - uv * uv));
}

inline double blur_px(const DiscView &view, double z) {
    constexpr double least_variance = least_blur_px * least_blur_px;
    const double variance = view.variance[0] + z * (view.variance[1] + z * view.variance[2]);
    return __builtin_sqrt(variance > least_variance ? variance : least_variance);
}

inline void blend(float *to, const float *from, const float *next, float share, float factor) {
    for (int k = 0; k < disc_nodes; k += lanes) {
        const Floats one = load<Floats>(from + k), other = load<Floats>(next + k);
        store(to + k, all(factor) * multiply_add(all(share), other - one, one));
    }
}

// Profile of a disc whose radius is `rho` blurs. Below the table shadows are as deep as the disc is large.
inline void interpolate(DiscProfile &profile, const DiscProfile *table, double rho) {
    const double held = rho > smallest_disc ? rho : smallest_disc, faint = (rho / held) * (rho / held);
    const int row = smaller(static_cast<int>(disc_rows_per_octave * __builtin_log2(held / smallest_disc)), disc_rows - 2);
    const double radius = smallest_disc * __builtin_exp2(row / double(disc_rows_per_octave));
    const double next = radius * __builtin_exp2(1.0 / disc_rows_per_octave);
    const float share = static_cast<float>((held - radius) / (next - radius)), factor = static_cast<float>(faint);
    blend(profile.log_transmission, table[row].log_transmission, table[row + 1].log_transmission, share, factor);
    blend(profile.pull, table[row].pull, table[row + 1].pull, share, factor);
    blend(profile.growth, table[row].growth, table[row + 1].growth, share, 1.0f);
}

inline void see(SeenDisc &disc, const Discs &discs, const DiscView &view, const double *position, double square) {
    disc.at = seen_at(discs.grid, view.nodes, view.shift_u, view.shift_v, position);
    const double blur = blur_px(view, position[2]), scale = image_scale(disc.at), rho = __builtin_sqrt(square) * scale / blur;
    disc.reach_px = (rho + discs.reach) * blur;
    const double u = disc.at.u, v = disc.at.v, reach = disc.reach_px;
    disc.empty = !(square > 0 && rho <= largest_disc && u > -reach && v > -reach && u < view.columns + reach && v < view.rows + reach);
    if (disc.empty) return;
    disc.top = larger(0, ceil_of(v - reach));
    disc.bottom = smaller(view.rows, floor_of(v + reach) + 1);
    disc.empty = disc.top >= disc.bottom;
    const double held = rho > smallest_disc ? rho : smallest_disc, inner = held > discs.reach ? held - discs.reach : 0;
    const double outer = held + discs.reach, nodes_per_blur2 = (disc_nodes - 2) / (outer * outer - inner * inner);
    disc.nodes_per_px2 = static_cast<float>(nodes_per_blur2 / (blur * blur));
    disc.inner_nodes = static_cast<float>(inner * inner * nodes_per_blur2);
    disc.pull_unit = -1 / (blur * blur);
    disc.growth_unit = scale * scale / (blur * blur);
    interpolate(disc.profile, discs.profiles, rho);
}

// Where pixels lie in a profile: between a node and the next one.
struct Places {
    Ints node;
    Floats share;
};

inline Floats at(const float *profile, const Places &places) {
    Floats one, next;
    look_up(profile, places.node, one, next);
    return multiply_add(places.share, next - one, one);
}

// Calls work(first pixel, offsets along u, offset along v, places in the profile) for vectors of all pixels in the window
// of a disc. Pixels of a vector that belong to another one, or lie beyond the disc, are at its last nodes, where it is nothing.
template <class Work>
inline void for_pixels(const DiscView &view, const SeenDisc &disc, Work work) {
    const Floats beyond = all(disc_nodes - 1.5f), zero{};
    for (int row = disc.top; row < disc.bottom; ++row) {
        const float offset_v = static_cast<float>(row - disc.at.v);
        const Floats square_v = all(offset_v * offset_v);
        const double rest = disc.reach_px * disc.reach_px - offset_v * offset_v, half = rest > 0 ? __builtin_sqrt(rest) : 0;
        const int left = larger(0, ceil_of(disc.at.u - half)), right = smaller(view.columns, floor_of(disc.at.u + half) + 1);
        for (int column = left; column < right; column += lanes) {
            const int first = smaller(column, view.columns - lanes);
            const Floats offset_u = lane_numbers() + all(static_cast<float>(first - disc.at.u));
            Floats place = multiply_add(offset_u, offset_u, square_v) * disc.nodes_per_px2 - disc.inner_nodes;
            place = lesser(place > zero ? place : zero, beyond);
            place = lane_numbers() < all(static_cast<float>(column - first)) ? beyond : place;
            const Ints node = __builtin_convertvector(place, Ints);
            work(static_cast<int64_t>(row) * view.columns + first, offset_u, offset_v,
                 Places{node, place - __builtin_convertvector(node, Floats)});
        }
    }
}

inline void add_disc(const DiscView &view, const SeenDisc &disc, float factor) {
    if (disc.empty) return;
    for_pixels(view, disc, [&](int64_t pixel, Floats, float, const Places &places) {
        float *logs = view.log_transmission + pixel;
        store(logs, multiply_add(all(factor), at(disc.profile.log_transmission, places), load<Floats>(logs)));
    });
}

// Weighted sums over the window of a disc: of products of the changes with u, v and the square of the radius, and of each
// times the residual.
struct DiscSums {
    double uu, uv, vv, us, vs, ss, u, v, s;
};

inline DiscSums sums_of(const DiscView &view, const SeenDisc &disc) {
    Floats uu{}, uv{}, vv{}, us{}, vs{}, ss{}, u{}, v{}, s{};
    for_pixels(view, disc, [&](int64_t pixel, Floats offset_u, float offset_v, const Places &places) {
        const Floats transmission = power_of_2(load<Floats>(view.log_transmission + pixel));
        const Floats residual = load<Floats>(view.image + pixel) - transmission;
        const Floats weight = load<Floats>(view.weight + pixel);
        const Floats pull = transmission * at(disc.profile.pull, places), along_u = pull * offset_u, along_v = pull * offset_v;
        const Floats growth = transmission * at(disc.profile.growth, places);
        const Floats weighted_u = weight * along_u, weighted_v = weight * along_v, weighted_s = weight * growth;
        uu = multiply_add(weighted_u, along_u, uu);
        uv = multiply_add(weighted_u, along_v, uv);
        vv = multiply_add(weighted_v, along_v, vv);
        us = multiply_add(weighted_u, growth, us);
        vs = multiply_add(weighted_v, growth, vs);
        ss = multiply_add(weighted_s, growth, ss);
        u = multiply_add(weighted_u, residual, u);
        v = multiply_add(weighted_v, residual, v);
        s = multiply_add(weighted_s, residual, s);
    });
    const double p = disc.pull_unit, g = disc.growth_unit;
    return {p * p * sum_of(uu), p * p * sum_of(uv), p * p * sum_of(vv), p * g * sum_of(us), p * g * sum_of(vs),
            g * g * sum_of(ss), p * sum_of(u), p * sum_of(v), g * sum_of(s)};
}

// The normal equations of one disc: x, y, z, and the square of its radius.
struct DiscNormal {
    double matrix[4][4] = {}, gradient[4] = {};

    void add(const Sighting &at, const DiscSums &sums) {
        for (int i = 0; i < 3; ++i) {
            const double u = at.along_u[i], v = at.along_v[i];
            gradient[i] += u * sums.u + v * sums.v;
            matrix[3][i] += u * sums.us + v * sums.vs;
            for (int j = 0; j <= i; ++j)
                matrix[i][j] += u * (sums.uu * at.along_u[j] + sums.uv * at.along_v[j]) +
                                v * (sums.uv * at.along_u[j] + sums.vv * at.along_v[j]);
        }
        gradient[3] += sums.s;
        matrix[3][3] += sums.ss;
    }
    // By Cholesky, with the damping of Levenberg; whether there is a solution.
    bool solve(double damping, double *step) {
        constexpr double of_size = 1.02;
        for (int i = 0; i < 3; ++i) matrix[i][i] += damping;
        matrix[3][3] *= of_size;
        for (int i = 0; i < 4; ++i) {
            for (int j = 0; j <= i; ++j) {
                double rest = matrix[i][j];
                for (int k = 0; k < j; ++k) rest -= matrix[i][k] * matrix[j][k];
                if (i > j) matrix[i][j] = rest / matrix[j][j];
                else if (!(rest > 0)) return false;
                else matrix[i][i] = __builtin_sqrt(rest);
            }
            step[i] = gradient[i];
            for (int k = 0; k < i; ++k) step[i] -= matrix[i][k] * step[k];
            step[i] /= matrix[i][i];
        }
        for (int i = 3; i >= 0; --i) {
            for (int k = i + 1; k < 4; ++k) step[i] -= matrix[k][i] * step[k];
            step[i] /= matrix[i][i];
        }
        return true;
    }
};

constexpr double least_square = 1e-4;  // of a radius: a disc that is not there

inline double next_square(double square, double step, double largest) {
    const double least = 0.25 * square, most = 2 * square + 0.1, wanted = square + step;
    const double held = !(wanted > least) ? least : wanted > most ? most : wanted;
    return held < least_square ? least_square : held > largest ? largest : held;
}

inline double size_of(double value) { return value < 0 ? -value : value; }

// Fits one disc, all others fixed; whether it changed. It stays as it is where that is as good.
inline bool fit_disc(const Discs &discs, const DiscSweeps &sweeps, SeenDisc *seen, int64_t number) {
    double *position = discs.positions + 3 * number, &square = discs.squares[number];
    DiscNormal normal;
    for (int view = 0; view < discs.n_views; ++view) {
        see(seen[view], discs, discs.views[view], position, square);
        if (!seen[view].empty) normal.add(seen[view].at, sums_of(discs.views[view], seen[view]));
    }
    sweeps.information[number] = normal.matrix[3][3];
    double step[4] = {0, 0, 0, -square};
    bool moved = false;
    if (normal.matrix[3][3] > 0) {
        step[3] = normal.gradient[3] / normal.matrix[3][3];
        double solved[4];
        moved = sweeps.move && normal.solve(sweeps.damping, solved);
        if (moved) std::memcpy(step, solved, sizeof step);
    }
    const double radius = __builtin_sqrt(square), next = next_square(square, step[3], sweeps.largest);
    const double length = __builtin_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    const double most = 0.3 + 0.2 * radius, share = length > most ? most / length : 1;
    const double change = share * length, grown = size_of(__builtin_sqrt(next) - radius);
    if (!((change > grown ? change : grown) > sweeps.tolerance)) return false;
    for (int view = 0; view < discs.n_views; ++view) add_disc(discs.views[view], seen[view], -1.0f);
    if (moved && length < 1e30)
        for (int i = 0; i < 3; ++i) position[i] += share * step[i];
    square = next;
    for (int view = 0; view < discs.n_views; ++view) {
        see(seen[view], discs, discs.views[view], position, square);
        add_disc(discs.views[view], seen[view], 1.0f);
    }
    return true;
}

int sweep_discs(const Discs &discs, const DiscSweeps &sweeps) {
    SeenDisc seen[max_views];
    for (int sweep = 0; sweep < sweeps.most; ++sweep) {
        const bool everybody = sweep % all_again == 0;
        bool any = false;
        for (int64_t number = 0; number < discs.count; ++number)
            if (everybody || sweeps.awake[number]) {
                sweeps.awake[number] = fit_disc(discs, sweeps, seen, number);
                any = any || sweeps.awake[number];
            }
        if (everybody && !any) return sweep + 1;
    }
    return sweeps.most;
}

void draw_discs(const Discs &discs, int view, double factor) {
    SeenDisc seen;
    for (int64_t number = 0; number < discs.count; ++number) {
        see(seen, discs, discs.views[view], discs.positions + 3 * number, discs.squares[number]);
        add_disc(discs.views[view], seen, static_cast<float>(factor));
    }
}

// What the window of a disc says beside its sums: see DiscSupport.
inline void weigh_window(const DiscView &view, const SeenDisc &disc, double square, DiscSupport &support) {
    Floats whole{}, missing{}, squares{}, pixels{}, placing{};
    const Floats zero{}, one = all(1.0f), within = all(disc_nodes - 2.5f);
    for_pixels(view, disc, [&](int64_t pixel, Floats offset_u, float offset_v, const Places &places) {
        const Floats transmission = power_of_2(load<Floats>(view.log_transmission + pixel));
        const Floats residual = load<Floats>(view.image + pixel) - transmission;
        const Floats inside = __builtin_convertvector(places.node, Floats) < within ? one : zero;
        const Floats weight = load<Floats>(view.weight + pixel) * inside;
        const Floats change = transmission - transmission * power_of_2(zero - at(disc.profile.log_transmission, places));
        whole = multiply_add(weight * change, change, whole);
        missing = multiply_add(weight * change, residual, missing);
        const Floats rest = weight * residual * residual, pull = transmission * at(disc.profile.pull, places);
        squares += rest;
        placing = multiply_add(rest * weight * pull * pull, multiply_add(offset_u, offset_u, all(offset_v * offset_v)), placing);
        pixels += weight > zero ? inside : zero;
    });
    support.whole = sum_of(whole) / (square * square);
    support.missing = sum_of(missing) / square;
    support.residual = sum_of(squares);
    support.pixels = sum_of(pixels);
    support.placing = disc.pull_unit * disc.pull_unit * sum_of(placing);
}

void weigh_discs(const Discs &discs, int view, DiscSupport *support) {
    SeenDisc seen;
    for (int64_t number = 0; number < discs.count; ++number) {
        support[number] = {};
        see(seen, discs, discs.views[view], discs.positions + 3 * number, discs.squares[number]);
        if (seen.empty) continue;
        const DiscSums sums = sums_of(discs.views[view], seen);
        support[number] = {sums.uu, sums.uv, sums.vv, sums.us, sums.vs, sums.ss, 0, 0, 0, 0, 0};
        weigh_window(discs.views[view], seen, discs.squares[number], support[number]);
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
