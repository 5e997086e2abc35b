// Line of sight, slab by slab.
#pragma once

#include "job.hpp"

namespace tomoshadow {

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads);
void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads);

}  // namespace tomoshadow
