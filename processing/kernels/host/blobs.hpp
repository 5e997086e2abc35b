// Peaks of volumes, from which blobs are tried.
#pragma once

#include <vector>

#include "job.hpp"

namespace tomoshadow {

struct Peak {
    double x, y, z, height;
};

// Voxels of the rows [first_row, end_row) of a volume that are at least as high as a threshold above 0, and that no
// neighbour exceeds; of equal neighbours the first one. In the order of the volume.
std::vector<Peak> find_peaks(const float *volume, const Shape &shape, int first_row, int end_row, float threshold);

}  // namespace tomoshadow
