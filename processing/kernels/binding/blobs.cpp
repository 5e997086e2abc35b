#include "host/blobs.hpp"

#include <nanobind/stl/vector.h>

#include <cmath>
#include <memory>
#include <vector>

#include "binding/arrays.hpp"
#include "binding/bind.hpp"
#include "host/instruction_set.hpp"
#include "host/parallel.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

using OpticsArray = nb::ndarray<const double, nb::shape<-1, 5>, nb::c_contig, nb::device::cpu>;
using SupportArray = nb::ndarray<double, nb::shape<-1, -1, 4>, nb::c_contig, nb::device::cpu>;
using NumpyTable = nb::ndarray<nb::numpy, double, nb::shape<-1, 4>>;

BlobView view_of(const ImageArray &residual, const double *nodes, const double *optics) {
    require(residual.shape(0) >= max_blob_window && residual.shape(1) >= max_blob_window && residual.size() < (1u << 30),
            "residual: an image of fewer than 64 rows or columns, or too large");
    for (int k = 0; k < 5; ++k) require(std::isfinite(optics[k]), "optics: finite numbers, please");
    const double widest = (max_blob_window / 2 - 1) / blob_reach;
    require(optics[0] > 0 && optics[1] > 0 && optics[2] > 0, "optics: gain and widths must be positive");
    require(optics[1] <= widest && optics[2] <= widest, "optics: a width beyond the window of a blob");
    return {residual.data(), static_cast<int>(residual.shape(0)), static_cast<int>(residual.shape(1)), nodes,
            optics[3], optics[4], optics[0], optics[1], optics[2]};
}

// Blobs with their views, checked.
struct BoundBlobs {
    std::vector<BlobView> views;
    Blobs blobs;

    BoundBlobs(const std::vector<ImageArray> &residuals, const LatticeArray &nodes, int spacing, const OpticsArray &optics,
               const PositionArray &positions, const NumberArray &amplitudes) {
        require(!residuals.empty() && residuals.size() <= max_views, "blobs: one to eight views, please");
        require(nodes.shape(0) == residuals.size() && optics.shape(0) == residuals.size(),
                "blobs: one lattice and optics per view");
        require(positions.shape(0) == amplitudes.shape(0), "blobs: as many positions as amplitudes, please");
        const size_t lattice = nodes.size() / nodes.shape(0);
        for (size_t k = 0; k < residuals.size(); ++k)
            views.push_back(view_of(residuals[k], nodes.data() + k * lattice, optics.data() + 5 * k));
        blobs = {views.data(),
                 static_cast<int>(views.size()),
                 node_grid(nodes, spacing),
                 positions.data(),
                 amplitudes.data(),
                 static_cast<int64_t>(amplitudes.shape(0))};
    }
};

void draw(const std::vector<ImageArray> &residuals, const LatticeArray &nodes, int spacing, const OpticsArray &optics,
          const PositionArray &positions, const NumberArray &amplitudes, double factor, int threads) {
    const BoundBlobs bound(residuals, nodes, spacing, optics, positions, amplitudes);
    require_threads(threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    for_each(bound.blobs.n_views, threads, [&](int view) { kernels.draw_blobs(bound.blobs, view, factor); });
}

int sweep(const std::vector<ImageArray> &residuals, const LatticeArray &nodes, int spacing, const OpticsArray &optics,
          const PositionArray &positions, const NumberArray &amplitudes, int most, bool move, double scale, double damping,
          double max_step, double tolerance) {
    const BoundBlobs bound(residuals, nodes, spacing, optics, positions, amplitudes);
    require(scale > 0 && damping >= 0 && max_step >= 0 && tolerance >= 0, "sweeps: scale positive, all else not negative");
    std::vector<uint8_t> awake(amplitudes.shape(0));
    const BlobSweeps sweeps{most, move, scale, damping, max_step, tolerance, awake.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return kernels.sweep_blobs(bound.blobs, sweeps);
}

void weigh(const std::vector<ImageArray> &residuals, const LatticeArray &nodes, int spacing, const OpticsArray &optics,
           const PositionArray &positions, const NumberArray &amplitudes, const SupportArray &out, int threads) {
    const BoundBlobs bound(residuals, nodes, spacing, optics, positions, amplitudes);
    require(out.shape(0) == bound.views.size() && out.shape(1) == amplitudes.shape(0), "support: (views, blobs, 4), please");
    static_assert(sizeof(BlobSupport) == 4 * sizeof(double), "a support is four numbers");
    require_threads(threads);
    auto *support = reinterpret_cast<BlobSupport *>(out.data());
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    for_each(bound.blobs.n_views, threads,
             [&](int view) { kernels.weigh_blobs(bound.blobs, view, support + view * bound.blobs.count); });
}

NumpyTable peaks(const FloatVolume &volume, int first_row, int end_row, float threshold) {
    const Shape shape = shape_of(volume);
    require(first_row >= 0 && first_row <= end_row && end_row <= shape.ny, "peaks: rows that the volume does not have");
    require(threshold > 0, "peaks: the threshold must be positive");
    auto found = std::make_unique<std::vector<Peak>>();
    {
        nb::gil_scoped_release release;
        *found = find_peaks(volume.data(), shape, first_row, end_row, threshold);
    }
    static_assert(sizeof(Peak) == 4 * sizeof(double), "a peak is four numbers");
    auto *numbers = reinterpret_cast<double *>(found->data());
    const size_t count = found->size();
    nb::capsule owner(found.get(), [](void *held) noexcept { delete static_cast<std::vector<Peak> *>(held); });
    found.release();
    return NumpyTable(numbers, {count, 4}, owner);
}

}  // namespace

void bind_blobs(nb::module_ &module) {
    module.attr("MAX_BLOB_WINDOW_PX") = max_blob_window;
    module.attr("BLOB_REACH_SIGMAS") = blob_reach;
    module.def("draw_blobs", &draw, "residuals"_a, "nodes"_a, "spacing"_a, "optics"_a, "positions"_a, "amplitudes"_a,
               "factor"_a, "threads"_a);
    module.def("sweep_blobs", &sweep, "residuals"_a, "nodes"_a, "spacing"_a, "optics"_a, "positions"_a, "amplitudes"_a,
               "most"_a, "move"_a, "scale"_a, "damping"_a, "max_step"_a, "tolerance"_a);
    module.def("weigh_blobs", &weigh, "residuals"_a, "nodes"_a, "spacing"_a, "optics"_a, "positions"_a, "amplitudes"_a, "out"_a,
               "threads"_a);
    module.def("find_peaks", &peaks, "volume"_a, "first_row"_a, "end_row"_a, "threshold"_a);
}

}  // namespace tomoshadow
