// Background division and sliding minimum. Windows slide along rows by doubling (windows of 2, 4, 8 ... pixels from two
// halves) and down columns by the method of van Herk and of Gil and Werman (a window is the end of one block and the
// beginning of the next): a few operations per pixel, whatever the window, and no running sum that would drift.
#pragma once

#include "simd/workspace.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr float darkest_background = 1e-3f;  // share of the full scale below which nobody knows what was in the way

struct Least {
    template <class Value>
    static Value of(Value a, Value b) {
        return a < b ? a : b;
    }
};

struct Sum {
    template <class Value>
    static Value of(Value a, Value b) {
        return a + b;
    }
};

template <class Grey>
void read_light(const Exposure &job, int row, const float *no_dark, float *__restrict light) {
    const int64_t first = static_cast<int64_t>(row) * job.columns;
    const Grey *__restrict grey = static_cast<const Grey *>(job.pixels) + first;
    const float *__restrict dark = job.dark ? job.dark + first : no_dark;
    if (!job.background) {
        const float share = 1.0f / job.full_scale;
        for (int k = 0; k < job.columns; ++k) light[k] = (static_cast<float>(grey[k]) - dark[k]) * share;
        return;
    }
    const float *__restrict background = job.background + first;
    const float darkest = darkest_background * job.full_scale;
    for (int k = 0; k < job.columns; ++k) {
        const float field = background[k] - dark[k], lost = 1.0f - (static_cast<float>(grey[k]) - dark[k]) / field;
        const float not_negative = lost > 0.0f ? lost : 0.0f, limited = not_negative < 1.0f ? not_negative : 1.0f;
        light[k] = field > darkest ? limited : 0.0f;
    }
}

inline void read_light(const Exposure &job, int row, const float *no_dark, float *light) {
    if (job.grey == Exposure::Grey::byte)
        read_light<uint8_t>(job, row, no_dark, light);
    else if (job.grey == Exposure::Grey::word)
        read_light<uint16_t>(job, row, no_dark, light);
    else
        read_light<float>(job, row, no_dark, light);
}

// A row that goes on for a window beyond its edges, and room for what is made of it.
class SlidingRow {
public:
    SlidingRow(int columns, int window)
        : columns_(columns),
          window_(window),
          length_((columns + window + 2 * lanes) / lanes * lanes),
          memory_(static_cast<int64_t>(sizeof(float)) * 2 * length_) {}

    // Where the row is to be written.
    float *pixels() { return ahead() + window_ / 2; }

    // The fold of the window around each pixel; the row is lost.
    template <class Fold>
    const float *fold() {
        continue_beyond_edges();
        float *const halves = ahead(), *const folded = memory_.as<float>() + length_;
        for (int width = 1; width <= window_; width *= 2) {
            const int behind = window_ & -2 * width;  // wider parts of the window come first: they begin on vectors
            if (window_ & width) {
                if ((window_ & (width - 1)) == 0)
                    std::memcpy(folded, halves + behind, sizeof(float) * static_cast<size_t>(columns_));
                else
                    for (int k = 0; k < columns_; k += lanes)
                        store(folded + k, Fold::of(load<Floats>(folded + k), load<Floats>(halves + k + behind)));
            }
            for (int k = 0; k < columns_ + behind - 2 * width; k += lanes)
                store(halves + k, Fold::of(load<Floats>(halves + k), load<Floats>(halves + k + width)));
        }
        return folded;
    }

private:
    float *ahead() { return memory_.as<float>(); }

    void continue_beyond_edges() {
        float *row = pixels();
        for (float *pixel = ahead(); pixel < row; ++pixel) *pixel = row[0];
        for (int k = columns_; k < columns_ + window_ - 1 - window_ / 2; ++k) row[k] = row[columns_ - 1];
    }

    int columns_, window_;
    int64_t length_;
    Memory memory_;
};

void row_minima(const Exposure &job, int first_row, int end_row) {
    SlidingRow sliding(job.columns, job.window);
    const Memory no_dark(static_cast<int64_t>(sizeof(float)) * job.columns);
    for (int row = first_row; row < end_row; ++row) {
        read_light(job, row, no_dark.as<float>(), sliding.pixels());
        std::memcpy(job.intensity + static_cast<int64_t>(row) * job.columns, sliding.fold<Least>(),
                    sizeof(float) * static_cast<size_t>(job.columns));
    }
}

// One row of a strip of columns.
struct Across {
    Floats parts[strip_columns / lanes];
};

template <class Fold>
inline Across fold(const Across &a, const Across &b) {
    Across folded;
    for (int k = 0; k < strip_columns / lanes; ++k) folded.parts[k] = Fold::of(a.parts[k], b.parts[k]);
    return folded;
}

// to[row] is the fold of the window around it; `ends` has room for one window.
template <class Fold>
void fold_down(const Across *from, Across *to, int rows, int window, Across *ends) {
    const auto at = [=](int k) -> const Across & { return from[larger(0, smaller(rows - 1, k - window / 2))]; };
    for (int block = 0; block < rows; block += window) {
        ends[window - 1] = at(block + window - 1);
        for (int k = window - 2; k >= 0; --k) ends[k] = fold<Fold>(at(block + k), ends[k + 1]);
        to[block] = ends[0];
        Across beginning = at(block + window);
        for (int k = 1; k < smaller(window, rows - block); ++k) {
            to[block + k] = fold<Fold>(ends[k], beginning);
            beginning = fold<Fold>(beginning, at(block + window + k));
        }
    }
}

// From minima along rows to their minima, and those to sums, down the columns of a strip.
void column_minima(const Exposure &job, int strip) {
    const int x0 = strip * strip_columns, columns = smaller(strip_columns, job.columns - x0);
    const Memory memory(static_cast<int64_t>(sizeof(Across)) * (2 * job.rows + job.window));
    Across *const lines = memory.as<Across>(), *const least = lines + job.rows, *const ends = least + job.rows;
    const size_t bytes = sizeof(float) * static_cast<size_t>(columns);
    const auto pixels = [&](int row) { return job.intensity + static_cast<int64_t>(row) * job.columns + x0; };
    for (int row = 0; row < job.rows; ++row) std::memcpy(lines + row, pixels(row), bytes);
    fold_down<Least>(lines, least, job.rows, job.window, ends);
    fold_down<Sum>(least, lines, job.rows, job.window, ends);
    for (int row = 0; row < job.rows; ++row) std::memcpy(pixels(row), lines + row, bytes);
}

// From sums down the columns to means of the window.
void row_means(const Exposure &job, int first_row, int end_row) {
    SlidingRow sliding(job.columns, job.window);
    const float share = 1.0f / (static_cast<float>(job.window) * static_cast<float>(job.window));
    for (int row = first_row; row < end_row; ++row) {
        float *pixels = job.intensity + static_cast<int64_t>(row) * job.columns;
        std::memcpy(sliding.pixels(), pixels, sizeof(float) * static_cast<size_t>(job.columns));
        const float *sums = sliding.fold<Sum>();
        for (int k = 0; k < job.columns; ++k) pixels[k] = sums[k] * share;
    }
}

// The intensities of rows that hold their veil.
void subtract_veil(const Exposure &job, int first_row, int end_row) {
    const Memory no_dark(static_cast<int64_t>(sizeof(float)) * job.columns);
    const Memory row_light(static_cast<int64_t>(sizeof(float)) * job.columns);
    const float *__restrict light = row_light.as<float>();
    const float stretch = 1.0f / (1.0f - job.noise_floor);
    for (int row = first_row; row < end_row; ++row) {
        read_light(job, row, no_dark.as<float>(), row_light.as<float>());
        float *__restrict pixels = job.intensity + static_cast<int64_t>(row) * job.columns;
        for (int k = 0; k < job.columns; ++k) {
            const float above = (light[k] - pixels[k] - job.noise_floor) * stretch;
            const float not_negative = above > 0.0f ? above : 0.0f;
            pixels[k] = not_negative < 1.0f ? not_negative : 1.0f;
        }
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
