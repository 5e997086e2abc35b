#include "host/preprocess.hpp"

#include <algorithm>

#include "host/parallel.hpp"

namespace tomoshadow {

namespace {

// Minima along rows and columns, then means along columns; those along rows are left to whoever wants them.
void minima(const Kernels &kernels, const Exposure &job, int threads) {
    for_rows(job.rows, threads, [&](int first, int end) { kernels.row_minima(job, first, end); });
    for_each((job.columns + strip_columns - 1) / strip_columns, threads,
             [&](int strip) { kernels.column_minima(job, strip); });
}

}  // namespace

void sliding_minimum(const Kernels &kernels, const Exposure &job, int threads) {
    minima(kernels, job, threads);
    for_rows(job.rows, threads, [&](int first, int end) { kernels.row_means(job, first, end); });
}

void preprocess(const Kernels &kernels, const Exposure &job, int threads) {
    if (job.window) minima(kernels, job, threads);
    for_rows(job.rows, threads, [&](int first, int end) {
        float *veil = job.intensity + static_cast<int64_t>(first) * job.columns;
        if (job.window)
            kernels.row_means(job, first, end);
        else
            std::fill(veil, veil + static_cast<int64_t>(end - first) * job.columns, 0.0f);
        kernels.subtract_veil(job, first, end);
    });
}

}  // namespace tomoshadow
