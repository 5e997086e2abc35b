// Who computes what: slabs are dealt to threads by number, so that the same input gives the same bits.
#pragma once

#include <functional>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Call work(i) for i = 0 .. count - 1; thread t takes i = t, t + threads, ...
void for_each(int count, int threads, const std::function<void(int)> &work);

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads);

// Bands project into images of their own, which are added in order: results do not depend on `threads`.
// sums[i] is the image of view i, or null where job.project[i] is false.
void run_smart_pass(const Kernels &kernels, const SmartPass &job, const std::vector<float *> &sums, int threads);

}  // namespace tomoshadow
