// What fits by coordinate descent share: where views see a position, from the nodes of a lattice.
#pragma once

#include "job.hpp"
#include "simd/lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr int all_again = 4;  // sweeps after which what rests is asked again, as its neighbours may have changed

// Where a view sees a position, and how that changes with x, y and z.
struct Sighting {
    double u, v, along_u[3], along_v[3];
};

struct NodeCell {
    int at;
    double along;
};

// Beyond the lattice its last cell goes on.
inline NodeCell node_cell(double position, int spacing, int nodes) {
    const double node = position / spacing, held = !(node > 0.0) ? 0.0 : node > nodes ? nodes : node;
    const int at = smaller(floor_of(held), nodes - 2);
    return {at, node - at};
}

inline Sighting seen_at(const NodeGrid &grid, const double *nodes, double shift_u, double shift_v, const double *position) {
    const NodeCell x = node_cell(position[0], grid.spacing, grid.nodes_x),
                   y = node_cell(position[1], grid.spacing, grid.nodes_y),
                   z = node_cell(position[2], grid.spacing, grid.nodes_z);
    const int64_t row = 2 * static_cast<int64_t>(grid.nodes_x), plane = row * grid.nodes_y;
    const double *corner = nodes + z.at * plane + y.at * row + 2 * x.at;
    double seen[2][4];  // value, and steps along x, y, z
    for (int axis = 0; axis < 2; ++axis) {
        double line[4], step[4];  // along x, at the four edges
        for (int edge = 0; edge < 4; ++edge) {
            const double *end = corner + (edge & 1) * row + (edge >> 1) * plane + axis;
            step[edge] = end[2] - end[0];
            line[edge] = end[0] + x.along * step[edge];
        }
        const double near = line[0] + y.along * (line[1] - line[0]), far = line[2] + y.along * (line[3] - line[2]);
        const double near_x = step[0] + y.along * (step[1] - step[0]), far_x = step[2] + y.along * (step[3] - step[2]);
        seen[axis][0] = near + z.along * (far - near);
        seen[axis][1] = near_x + z.along * (far_x - near_x);
        seen[axis][2] = (line[1] - line[0]) + z.along * ((line[3] - line[2]) - (line[1] - line[0]));
        seen[axis][3] = far - near;
    }
    const double per_voxel = 1.0 / grid.spacing;
    return {seen[0][0] + shift_u,
            seen[1][0] + shift_v,
            {seen[0][1] * per_voxel, seen[0][2] * per_voxel, seen[0][3] * per_voxel},
            {seen[1][1] * per_voxel, seen[1][2] * per_voxel, seen[1][3] * per_voxel}};
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
