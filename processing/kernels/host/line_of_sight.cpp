#include "host/line_of_sight.hpp"

#include "host/parallel.hpp"

namespace tomoshadow {

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads) {
    for_each((job.shape.ny + sight_rows - 1) / sight_rows, threads, [&](int slab) { kernels.line_of_sight(job, slab); });
}

void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads) {
    for_each((job.shape.ny + sight_rows - 1) / sight_rows, threads, [&](int slab) { kernels.sum_of_sight(job, slab); });
}

}  // namespace tomoshadow
