// Where images are empty, so that kernels skip what sees nothing.
#pragma once

#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Cells of an image and their sums, see Occupancy.
struct OccupiedCells {
    std::vector<int32_t> sums;
    int columns;
};
OccupiedCells occupied_cells(const int16_t *pixels, int rows, int columns);

}  // namespace tomoshadow
