// Images on their way to the kernels: fixed point and resampling.
#pragma once

#include "job.hpp"

namespace tomoshadow {

// A recorded image of intensities, or a part of one.
struct Recorded {
    const float *pixels;
    int rows, columns;
    int64_t stride;  // from row to row
    const float *row(int number) const { return pixels + number * stride; }
};

// Write intensities in fixed point into the middle of an image of (rows + before + after) x (columns + before + after)
// pixels; the frame is set to zero. Returns the intensity of one count. Where intensities are infinite, negative or not
// numbers, that is not finite, and nothing is written.
float quantise(const Kernels &kernels, const Recorded &image, int before, int after, int16_t *to, int threads);

// Resample a recorded image onto rows x columns pixels, see Resampling. Returns the intensity of one count, as above.
float resample(const Kernels &kernels, const Recorded &image, const float *nodes, int nodes_x, int16_t *to, int rows,
               int columns, int threads);

}  // namespace tomoshadow
