// Exposures on their way to the intensities that reconstruction takes.
#pragma once

#include "job.hpp"

namespace tomoshadow {

// The light of an exposure, inverted if there is a background, less its sliding minimum and noise floor, 0 .. 1.
void preprocess(const Kernels &kernels, const Exposure &exposure, int threads);

// The sliding minimum of the light alone: the least of a window around each pixel, averaged over the same window.
// Beyond its edge an image goes on as it ends. Of an even window, one pixel more lies before than after.
void sliding_minimum(const Kernels &kernels, const Exposure &exposure, int threads);

}  // namespace tomoshadow
