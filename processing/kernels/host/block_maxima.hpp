// Maxima of cubes of voxels: what a preview shows of a volume.
#pragma once

#include "job.hpp"

namespace tomoshadow {

// Rows of a volume of numbers from 0 on, and the maxima of its blocks, which grow as more of its rows come.
struct BlockMaxima {
    const void *slab;
    Shape shape;         // of the slab; its rows and columns lie side by side
    int64_t plane;       // from plane to plane of the slab, in voxels
    int first_row;       // of the slab, in the volume
    int factor;          // voxels along the edge of a block
    void *maxima;        // of the same format
    int rows, columns;   // of the maxima
    Format format;
};

void add_block_maxima(const BlockMaxima &job, int threads);

}  // namespace tomoshadow
