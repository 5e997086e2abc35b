// Who computes what: slabs are dealt to threads by number, so that the same input gives the same bits.
#pragma once

#include <functional>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Call work(i) for i = 0 .. count - 1; thread t takes i = t, t + threads, ...
void for_each(int count, int threads, const std::function<void(int)> &work);

// The same for the rows of an image, a few at once: work(first row, end row).
void for_rows(int rows, int threads, const std::function<void(int, int)> &work);

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads);
void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads);

// What the volume looks like from each view, in parts: bands of slabs project into images of their own.
class BandImages {
public:
    BandImages(const std::vector<View> &views, const Shape &shape);

    // Let `work` project slab after slab, band by band, onto the wanted views.
    void project(const std::vector<bool> &wanted, int threads,
                 const std::function<void(int slab, const Projection *projections)> &work);
    // The sum of the latest projection onto a view, in units of the volume.
    double sum(int view) const;
    // Set the ratio image of a view from its latest projection: the parts that `job` lacks, in order. Returns the sum
    // of (projected - recorded)^2.
    double correct(const Kernels &kernels, int view, Correction job, int threads) const;

private:
    std::vector<Projection> parts(int view) const;

    struct alignas(64) Line {
        float pixels[16];
    };
    struct Images {
        int first_slab, end_slab;
        std::vector<std::vector<Line>> memory;
        std::vector<Projection> parts;
    };
    std::vector<Images> bands_;
};

}  // namespace tomoshadow
