#include "host/stamping.hpp"

#include <algorithm>
#include <cmath>

namespace tomoshadow {

namespace {

// Where a ball is looked at: displaced by these, with equal weights.
struct Nodes {
    static constexpr int most = 8;
    double offsets[most][3] = {};
    int count = 1;
};

// Two on a way, those of Gauss-Legendre: exact second moment.
void spread_along(Nodes &nodes, const double *way) {
    const double node = 1 / std::sqrt(12.0);
    for (int n = nodes.count; n-- > 0;)
        for (int axis = 0; axis < 3; ++axis) {
            nodes.offsets[nodes.count + n][axis] = nodes.offsets[n][axis] - node * way[axis];
            nodes.offsets[n][axis] += node * way[axis];
        }
    nodes.count *= 2;
}

Nodes nodes_of(const Stamp &stamp, bool sampled_finely) {
    Nodes nodes;
    if (sampled_finely)
        for (int axis = 1; axis < 3; ++axis) {
            double half[3] = {};
            half[axis] = std::sqrt(12.0) / 4;  // a quarter of a voxel to either side
            spread_along(nodes, half);
        }
    if (stamp.smear[0] != 0 || stamp.smear[1] != 0 || stamp.smear[2] != 0) spread_along(nodes, stamp.smear);
    return nodes;
}

// Indices of an axis that a ball reaches, end excluded.
struct Range {
    int begin, end;
};

double reach_of(const Stamp &stamp, int axis) { return stamp.reach + 0.5 * std::abs(stamp.smear[axis]) + 0.25; }

Range reached(const Stamp &stamp, int axis, int size, double reach) {
    const double begin = std::ceil(stamp.centre[axis] - reach), end = std::floor(stamp.centre[axis] + reach) + 1;
    return {static_cast<int>(std::clamp(begin, 0.0, double(size))), static_cast<int>(std::clamp(end, 0.0, double(size)))};
}

// Half of what a ball reaches of a row.
double chord_of(const Stamp &stamp, int y) {
    const double off = std::abs(y - stamp.centre[1]) / reach_of(stamp, 1);
    return reach_of(stamp, 2) * std::sqrt(std::max(1 - off * off, 0.0));
}

void stamp_ball(float *volume, const Shape &shape, const Stamp &stamp, const Nodes &nodes, const Profiles &profiles) {
    const Range planes = reached(stamp, 0, shape.nz, reach_of(stamp, 0)), rows = reached(stamp, 1, shape.ny, reach_of(stamp, 1));
    const float *profile = profiles.opacities + static_cast<int64_t>(stamp.profile) * profiles.columns;
    const float last = static_cast<float>(profiles.columns - 1), per_area = static_cast<float>(stamp.per_area);
    const float weight = static_cast<float>(stamp.opacity / nodes.count);
    for (int z = planes.begin; z < planes.end; ++z)
        for (int y = rows.begin; y < rows.end; ++y) {
            const Range across = reached(stamp, 2, shape.nx, chord_of(stamp, y));
            float *row = volume + (static_cast<int64_t>(z) * shape.ny + y) * shape.nx;
            float off_row[Nodes::most], first[Nodes::most];
            for (int node = 0; node < nodes.count; ++node) {
                const double *offset = nodes.offsets[node];
                const double dz = z - stamp.centre[0] - offset[0], dy = y - stamp.centre[1] - offset[1];
                off_row[node] = static_cast<float>(dz * dz + dy * dy);
                first[node] = static_cast<float>(across.begin - stamp.centre[2] - offset[2]);
            }
            for (int x = across.begin; x < across.end; ++x) {
                float opacity = 0;
                for (int node = 0; node < nodes.count; ++node) {
                    const float dx = first[node] + static_cast<float>(x - across.begin);
                    const float at = std::min((dx * dx + off_row[node]) * per_area, last);
                    const int column = std::min(static_cast<int>(at), profiles.columns - 2);
                    opacity += profile[column] + (at - column) * (profile[column + 1] - profile[column]);
                }
                row[x] *= 1 - weight * opacity;
            }
        }
}

}  // namespace

void stamp_balls(float *volume, const Shape &shape, const Stamp *stamps, int64_t count, const Profiles &profiles,
                 bool sampled_finely) {
    for (const Stamp *stamp = stamps; stamp != stamps + count; ++stamp)
        stamp_ball(volume, shape, *stamp, nodes_of(*stamp, sampled_finely), profiles);
}

}  // namespace tomoshadow
