// The area that opaque discs cover together, whatever they hide of each other.
#pragma once

#include <cstdint>

namespace tomoshadow {

constexpr int coverage_cells = 2;  // along a row and a column of a pixel; every second one is at the centre of a pixel
constexpr int coverage_lines = 4;  // into which a cell is cut

// Covered share of every cell, (coverage_cells rows, coverage_cells columns). Of every disc, the area in each line of a cell is
// exact; lines are united as if it began and ended at one place each. Centres are pairs (u, v), in px as the radii; those that are not finite are left out.
void cover(const double *centres, const double *radii, int64_t count, float *cells, int rows, int columns);

}  // namespace tomoshadow
