// Who computes what: slabs are dealt to threads by number, so that the same input gives the same bits.
#pragma once

#include <functional>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Call work(i) for i = 0 .. count - 1; thread t takes i = t, t + threads, ...
void for_each(int count, int threads, const std::function<void(int)> &work);

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads);
void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads);

// Work through bands of slabs that project into images of their own, which are then added in order. sums[i] is the
// image of view i, or null if that is not wanted.
void run_bands(const SmartPass &job, const std::vector<float *> &sums, int threads,
               const std::function<void(int slab, const Projection *projections)> &work);

}  // namespace tomoshadow
