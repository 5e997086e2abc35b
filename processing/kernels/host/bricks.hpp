// A line-of-sight volume that is stored where it is not empty.
#pragma once

#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Blocks of sight_rows x block_columns voxels of one plane, in float16; slab after slab, whatever the threads.
struct Bricks {
    std::vector<int32_t> positions;  // (z, y, x) of the first voxel of each
    std::vector<uint16_t> values;
};

Bricks bricks_of_sight(const Kernels &kernels, const SparseSight &job, int threads);

}  // namespace tomoshadow
