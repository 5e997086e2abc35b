// Exposures on their way to the intensities that reconstruction takes.
#pragma once

#include <cstdint>

namespace tomoshadow {

// A recorded exposure, all arrays contiguous and of the same shape. Its light is what it recorded less the dark image:
// divided by that of the background and inverted, or, without one, by the full scale.
struct Exposure {
    enum class Grey { byte, word, single };  // uint8, uint16, float32
    const void *pixels;
    Grey grey;
    int rows, columns;
    const float *dark, *background;  // or null
    float full_scale;
    int window;         // edge of the sliding minimum in pixels; 0: none
    float noise_floor;  // of the intensity
    float *intensity;   // the result; meanwhile minima and their means
};

constexpr int strip_columns = 64;  // columns that are worked on at once

struct Kernels;

// The light of an exposure, inverted if there is a background, less its sliding minimum and noise floor, 0 .. 1.
void preprocess(const Kernels &kernels, const Exposure &exposure, int threads);

// The sliding minimum of the light alone: the least of a window around each pixel, averaged over the same window.
// Beyond its edge an image goes on as it ends. Of an even window, one pixel more lies before than after.
void sliding_minimum(const Kernels &kernels, const Exposure &exposure, int threads);

}  // namespace tomoshadow
