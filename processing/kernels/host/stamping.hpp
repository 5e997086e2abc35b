// Blurred discs and balls multiplied into an image or a volume.
#pragma once

#include "job.hpp"

namespace tomoshadow {

// A ball at (z, y, x), in the middle of its way through the exposure.
struct Stamp {
    double centre[3], smear[3];
    double reach;     // beyond, it is transparent
    double per_area;  // columns of its profile per squared distance
    double opacity;
    double profile;   // which row of the table
};

// Opacities of balls against the squared distance from their centres, linear in between; the last column is 0.
struct Profiles {
    const float *opacities;
    int rows, columns;
};

// Multiplies the transmittances of balls into a volume, one after the other; an image is a volume of one plane.
// A transmittance is that of the middle of a voxel, or, sampled finely, the mean of four places of its plane.
void stamp_balls(float *volume, const Shape &shape, const Stamp *stamps, int64_t count, const Profiles &profiles,
                 bool sampled_finely);

}  // namespace tomoshadow
