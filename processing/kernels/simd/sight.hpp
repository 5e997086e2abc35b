// What a tile is in all exposures: of two to four rectified views at once, row by row in registers; of others view
// by view.
#pragma once

#include <type_traits>

#include "simd/output.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int most_at_once = 4;  // exposures whose rows stay in the cache together

// One or more exposures of the same views, which share their geometry.
struct Exposures {
    const View *views;  // views[exposure * n_views + i]
    int n_views, count;
    Method method;
    const View *exposure(int e) const { return views + static_cast<int64_t>(e) * n_views; }
};

// Where the columns of a tile are seen in n views.
template <int n>
struct ColumnTaps {
    Taps taps[n][parts];
    [[gnu::always_inline]] ColumnTaps(const PlaneTaps *planes, const Tile &tile) {
#pragma GCC unroll 4
        for (int i = 0; i < n; ++i) planes[i].columns.taps(tile.x0, taps[i]);
    }
};

// From samples to intensities, all views at once.
template <int n, bool minimum>
struct Combination {
    float factor[n];
    // Samples have up to 29 bits: a float holds the product of two before it is scaled.
    [[gnu::always_inline]] Combination(const View *views, float gain) {
        for (int i = 0; i < n; ++i) factor[i] = views[i].unit * sample_unit;
        factor[0] *= gain;
        if (!minimum)
            for (int i = 0; i + 1 < n; i += 2) factor[i] *= factor[i + 1];
    }
    [[gnu::always_inline]] Floats add(Floats before, Floats seen, int i) const {
        if (minimum || i % 2 == 0) seen = seen * factor[i];
        if (i == 0) return seen;
        return minimum ? lesser(seen, before) : before * seen;
    }
};

// Hand every row of a tile to take(row, values), `parts` vectors. Compact columns of a view may be picked from the same
// window of pixels. What is in memory is read first: compilers cannot know that `take` leaves it alone.
template <int n, bool minimum, bool compact, class Take>
inline void see_rows(const View *views, const PlaneTaps *planes, const ColumnTaps<n> &columns, int rows, float gain, const Take &take) {
    const Combination<n, minimum> combination(views, gain);
    constexpr bool one_window = compact && window_of_a_row;
    const int16_t *above[n], *below[n];
    for (int i = 0; i < n; ++i) {
        above[i] = views[i].pixels + (one_window ? columns.taps[i][0].first : 0);
        below[i] = above[i] + views[i].columns;
    }
    for (int row = 0; row < rows; ++row) {
        Floats seen[parts];
#pragma GCC unroll 4
        for (int i = 0; i < n; ++i) {
            const RowTaps &between = planes[i].rows;
            const int64_t offset = between.above[row];
            Window window;
            if constexpr (one_window) window = blend(above[i] + offset, below[i] + offset, between.weight[row]);
#pragma GCC unroll 8
            for (int part = 0; part < parts; ++part) {
                const Taps &taps = columns.taps[i][part];
                if constexpr (!one_window) window = blend<compact>(above[i] + offset, below[i] + offset, between.weight[row], taps);
                seen[part] = combination.add(seen[part], pick(window, taps), i);
            }
        }
        take(row, seen);
    }
}

// Which exposures may see something in the blocks of some planes, looked up before they are visited: the answers hardly
// change from plane to plane, so that processors guess them.
class Seen {
public:
    Seen(int planes, int nx) : blocks_(nx / block_columns + 1), bits_(static_cast<int64_t>(planes) * blocks_) {}
    // The blocks of one plane from a tile on.
    void look(const Exposures &from, const PlaneTaps *taps, int plane, Tile tile, int x_end) const {
        const int first = tile.x0;
        std::memset(&at(plane, first), (1 << from.count) - 1, static_cast<size_t>((x_end - first - 1) / block_columns + 1));
        for (int i = 0; i < from.n_views; ++i)
            for (tile.x0 = first; tile.x0 < x_end; tile.x0 += block_columns) {
                uint8_t &bits = at(plane, tile.x0);
                if (bits) bits = static_cast<uint8_t>(bits & seen_by(from, i, cells_around(from.views[i], taps[i], tile)));
            }
    }
    // Bit e is set where exposure e may see something in the block at x0.
    uint32_t exposures(int plane, int x0) const { return at(plane, x0); }

private:
    static uint32_t seen_by(const Exposures &from, int i, const CellBox &box) {
        uint32_t bits = 0;
        for (int e = 0; e < from.count; ++e) {
            const Occupancy &occupancy = from.exposure(e)[i].occupancy;
            bits |= static_cast<uint32_t>(!occupancy.sums || occupancy.any(box)) << e;
        }
        return bits;
    }
    uint8_t &at(int plane, int x0) const { return bits_.as<uint8_t>()[plane * blocks_ + x0 / block_columns]; }

    int blocks_;
    Memory bits_;
};

inline bool all_rectified(const View *views, int n_views) {
    for (int i = 0; i < n_views; ++i)
        if (views[i].nodes) return false;
    return true;
}

template <int n>
inline bool all_compact(const PlaneTaps *planes) {
    bool compact = true;
    for (int i = 0; i < n; ++i) compact = compact && planes[i].columns.compact();
    return compact;
}

// Calls with the number of views as a constant, where so many views are seen at once.
template <class Call>
[[gnu::always_inline]] inline bool at_once(bool rectified, int n_views, const Call &call) {
    if (!rectified || n_views > 4) return false;
    if (n_views == 4) call(std::integral_constant<int, 4>());
    if (n_views == 3) call(std::integral_constant<int, 3>());
    if (n_views == 2) call(std::integral_constant<int, 2>());
    if (n_views == 1) call(std::integral_constant<int, 1>());
    return true;
}

template <int n, bool minimum, class Take>
inline void see_all(const View *views, const PlaneTaps *planes, const ColumnTaps<n> &columns, int rows, float gain, const Take &take) {
    if (all_compact<n>(planes))
        see_rows<n, minimum, true>(views, planes, columns, rows, gain, take);
    else
        see_rows<n, minimum, false>(views, planes, columns, rows, gain, take);
}

// Some views, one after the other in memory.
struct Together {
    const View *views;
    const PlaneTaps *planes;
    int count;
    bool rectified;
};

// Hand every row of the product of what some views see of a tile, times `gain`, to take(row, values), `parts` vectors.
template <class Take>
inline void see_product(const Together &from, const Tile &tile, float gain, const Take &take) {
    const auto see_them = [&](auto count) __attribute__((always_inline)) {
        constexpr int n = count;
        see_all<n, false>(from.views, from.planes, ColumnTaps<n>(from.planes, tile), tile.rows, gain, take);
    };
    if (at_once(from.rectified, from.count, see_them)) return;
    Block block;
    sample_product(from.views, from.count, from.planes, tile, block);
    for (int row = 0; row < tile.rows; ++row) {
        for (Floats &value : block.vectors[row]) value *= gain;
        take(row, block.vectors[row]);
    }
}

template <int n, class Take>
inline void see_together(const Exposures &from, uint32_t seen, const PlaneTaps *planes, const Tile &tile, const Take &take) {
    const ColumnTaps<n> columns(planes, tile);
    for (; seen; seen &= seen - 1) {
        const View *views = from.exposure(__builtin_ctz(seen));
        if (from.method == Method::minimum)
            see_all<n, true>(views, planes, columns, tile.rows, 1.0f, take);
        else
            see_all<n, false>(views, planes, columns, tile.rows, 1.0f, take);
    }
}

template <class Take>
inline void see_one_by_one(const Exposures &from, uint32_t seen, const PlaneTaps *planes, const Tile &tile,
                           const Take &take) {
    Block block;
    for (; seen; seen &= seen - 1) {
        const View *views = from.exposure(__builtin_ctz(seen));
        if (from.method == Method::minimum)
            sample_minimum(views, from.n_views, planes, tile, block);
        else
            sample_product(views, from.n_views, planes, tile, block);
        for (int row = 0; row < tile.rows; ++row) take(row, block.vectors[row]);
    }
}

template <class Take>
inline void see_exposures(const Exposures &from, uint32_t seen, const PlaneTaps *planes, const Tile &tile,
                          const Take &take) {
    const auto see_them = [&](auto count) __attribute__((always_inline)) { see_together<count>(from, seen, planes, tile, take); };
    if (!at_once(all_rectified(from.views, from.n_views), from.n_views, see_them)) see_one_by_one(from, seen, planes, tile, take);
}

// Hand every row of the tile in every exposure that may see something there, bit e of `seen`, to take(row, values),
// `parts` vectors.
template <class Take>
inline void see(const Exposures &from, uint32_t seen, const PlaneTaps *planes, const Tile &tile, const Take &take) {
    if (from.method == Method::geometric_mean)
        see_exposures(from, seen, planes, tile, [&](int row, Floats (&values)[parts]) {
            for (Floats &value : values) value = root(value, from.n_views);
            take(row, values);
        });
    else
        see_exposures(from, seen, planes, tile, take);
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
