#include "host/resample.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "host/parallel.hpp"

namespace tomoshadow {

namespace {

struct Range {
    float low = INFINITY, high = -INFINITY;
    void include(float value) {
        low = std::min(low, value);
        high = std::max(high, value);
    }
    // With what cubic convolution reads around; at least one pixel.
    int begin(int pixels) const { return limited(low - 4.0f, pixels); }
    int end(int pixels) const { return std::max(begin(pixels), limited(high + 4.0f, pixels)) + 1; }

private:
    static int limited(float at, int pixels) {
        return static_cast<int>(std::clamp(at, 0.0f, static_cast<float>(pixels - 1)));
    }
};

// The pixels that nodes (u, v) point to. A region of interest needs few.
PixelBox pixels_needed(const Recorded &image, const float *nodes, int count) {
    Range u, v;
    for (int k = 0; k < count; ++k) {
        u.include(nodes[2 * k]);
        v.include(nodes[2 * k + 1]);
    }
    return {v.begin(image.rows), v.end(image.rows), u.begin(image.columns), u.end(image.columns)};
}

Recorded part(const Recorded &image, const PixelBox &box) {
    return {image.row(box.top) + box.left, box.bottom - box.top, box.right - box.left, image.stride};
}

// Memory that waits for the next image: fresh memory costs more than what is written to it.
template <class T>
class Scratch {
public:
    T *of(size_t count) {
        if (count > count_) {
            memory_.reset(new T[count]);  // not a vector, which would write zeros first
            count_ = count;
        }
        return memory_.get();
    }

private:
    std::unique_ptr<T[]> memory_;
    size_t count_ = 0;
};

// The brightest pixel of a row within a box, or what is no intensity, wherever in the row that is.
float brightest_of_row(const Kernels &kernels, const Recorded &image, const PixelBox &box, int row) {
    const bool inside = row >= box.top && row < box.bottom;
    const int left = inside ? box.left : 0, right = inside ? box.right : 0;
    const float *pixels = image.row(row);
    const float around = kernels.brightest(pixels, left) + kernels.brightest(pixels + right, image.columns - right);
    return std::isfinite(around) ? kernels.brightest(pixels + left, right - left) : around;
}

// Of the brightest pixel in a box; not finite where a pixel of the image is no intensity.
float unit_of(const Kernels &kernels, const Recorded &image, const PixelBox &box, int threads) {
    std::vector<float> brightest(static_cast<size_t>(image.rows), 0.0f);
    for_rows(image.rows, threads, [&](int first, int end) {
        for (int row = first; row < end; ++row) brightest[row] = brightest_of_row(kernels, image, box, row);
    });
    float largest = 0.0f;
    for (const float row : brightest) {
        if (!std::isfinite(row)) return row;
        largest = std::max(largest, row);
    }
    return (largest > 0.0f ? largest : 1.0f) / 32767.0f;
}

// One row of a frame of zeros with the image in it.
void quantise_row(const Kernels &kernels, const Recorded &image, int row, int before, float unit, int16_t *line, int columns) {
    if (row < 0 || row >= image.rows) {
        std::fill(line, line + columns, int16_t(0));
        return;
    }
    std::fill(line, line + before, int16_t(0));
    kernels.quantise(image.row(row), 1.0f / unit, line + before, image.columns);
    std::fill(line + before + image.columns, line + columns, int16_t(0));
}

}  // namespace

float quantise(const Kernels &kernels, const Recorded &image, int before, int after, int16_t *to, int threads) {
    const float unit = unit_of(kernels, image, {0, image.rows, 0, image.columns}, threads);
    if (!std::isfinite(unit)) return unit;
    const int columns = image.columns + before + after;
    for_rows(image.rows + before + after, threads, [&](int first, int end) {
        for (int row = first; row < end; ++row)
            quantise_row(kernels, image, row - before, before, unit, to + static_cast<int64_t>(row) * columns, columns);
    });
    return unit;
}

float resample(const Kernels &kernels, const Recorded &image, const float *nodes, int nodes_x, int16_t *to, int rows,
               int columns, int threads) {
    constexpr int margin = Resampling::margin;
    const PixelBox box = pixels_needed(image, nodes, ((rows - 1) / Resampling::node_spacing + 2) * nodes_x);
    const float unit = unit_of(kernels, image, box, threads);
    if (!std::isfinite(unit)) return unit;
    const Recorded needed = part(image, box);
    const int from_rows = needed.rows + 2 * margin, from_columns = needed.columns + 2 * margin;
    const int64_t cells = FilledCells::stride(from_columns);
    thread_local Scratch<int16_t> pixels;
    thread_local Scratch<uint8_t> flags;
    int16_t *const from = pixels.of(static_cast<size_t>(from_rows) * from_columns);
    uint8_t *const filled = flags.of(static_cast<size_t>(from_rows * cells));
    for_rows(from_rows, threads, [&](int first, int end) {
        for (int row = first; row < end; ++row) {
            int16_t *line = from + static_cast<int64_t>(row) * from_columns;
            quantise_row(kernels, needed, row - margin, margin, unit, line, from_columns);
            kernels.find_filled(line, from_columns, filled + row * cells);
        }
    });
    const Resampling job{from,
                         filled,
                         from_rows,
                         from_columns,
                         static_cast<float>(margin - box.left),
                         static_cast<float>(margin - box.top),
                         nodes,
                         nodes_x,
                         to,
                         columns};
    for_rows(rows, threads, [&](int first, int end) { kernels.resample(job, first, end); });
    return unit;
}

}  // namespace tomoshadow
