#include <nanobind/stl/vector.h>

#include <cmath>
#include <vector>

#include "binding/arrays.hpp"
#include "binding/bind.hpp"
#include "host/coverage.hpp"
#include "host/instruction_set.hpp"
#include "host/parallel.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

using Images = std::vector<ImageArray>;
using RecordedImages = std::vector<RecordedArray>;
using OpticsArray = nb::ndarray<const double, nb::shape<-1, 5>, nb::c_contig, nb::device::cpu>;
using ProfileArray = nb::ndarray<const float, nb::shape<disc_rows, 3, disc_nodes>, nb::c_contig, nb::device::cpu>;
using SupportArray = nb::ndarray<double, nb::shape<-1, -1, 11>, nb::c_contig, nb::device::cpu>;

constexpr size_t least_pixels = 64;  // rows and columns of an image

bool same_shape(const ImageArray &image, const RecordedArray &other) {
    return image.shape(0) == other.shape(0) && image.shape(1) == other.shape(1);
}

DiscView view_of(const ImageArray &logs, const double *nodes, const double *optics) {
    require(logs.shape(0) >= least_pixels && logs.shape(1) >= least_pixels && logs.size() < (1u << 30),
            "log_transmission: an image of fewer than 64 rows or columns, or too large");
    for (int k = 0; k < 5; ++k) require(std::isfinite(optics[k]), "optics: finite numbers, please");
    return {logs.data(), nullptr, nullptr, static_cast<int>(logs.shape(0)), static_cast<int>(logs.shape(1)), nodes,
            optics[0], optics[1], {optics[2], optics[3], optics[4]}};
}

// Discs with their views, checked.
struct BoundDiscs {
    std::vector<DiscView> views;
    Discs discs;

    BoundDiscs(const Images &logs, const LatticeArray &nodes, int spacing, const OpticsArray &optics,
               const ProfileArray &profiles, double reach, const PositionArray &positions, const NumberArray &squares) {
        require(reach > 0 && std::isfinite(reach), "discs: a reach above 0, please");
        require(!logs.empty() && logs.size() <= max_views, "discs: one to eight views, please");
        require(nodes.shape(0) == logs.size() && optics.shape(0) == logs.size(), "discs: one lattice and optics per view");
        require(positions.shape(0) == squares.shape(0), "discs: as many positions as squares, please");
        static_assert(sizeof(DiscProfile) == 3 * disc_nodes * sizeof(float), "a profile is three rows of nodes");
        const size_t lattice = nodes.size() / nodes.shape(0);
        for (size_t k = 0; k < logs.size(); ++k)
            views.push_back(view_of(logs[k], nodes.data() + k * lattice, optics.data() + 5 * k));
        discs = {views.data(),
                 static_cast<int>(views.size()),
                 node_grid(nodes, spacing),
                 reinterpret_cast<const DiscProfile *>(profiles.data()),
                 reach,
                 positions.data(),
                 squares.data(),
                 static_cast<int64_t>(squares.shape(0))};
    }
    void see(const RecordedImages &images, const RecordedImages &weights) {
        require(images.size() == views.size() && weights.size() == views.size(), "discs: one image and weight per view");
        for (size_t k = 0; k < views.size(); ++k) {
            views[k].image = images[k].data();
            views[k].weight = weights[k].data();
        }
    }
};

void require_same_shapes(const Images &logs, const RecordedImages &images, const RecordedImages &weights) {
    require(images.size() == logs.size() && weights.size() == logs.size(), "discs: one image and weight per view");
    for (size_t k = 0; k < logs.size(); ++k)
        require(same_shape(logs[k], images[k]) && same_shape(logs[k], weights[k]), "discs: images of one shape per view");
}

void draw(const Images &logs, const LatticeArray &nodes, int spacing, const OpticsArray &optics, const ProfileArray &profiles,
          double reach, const PositionArray &positions, const NumberArray &squares, double factor, int threads) {
    const BoundDiscs bound(logs, nodes, spacing, optics, profiles, reach, positions, squares);
    require_threads(threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    for_each(bound.discs.n_views, threads, [&](int view) { kernels.draw_discs(bound.discs, view, factor); });
}

int sweep(const Images &logs, const RecordedImages &images, const RecordedImages &weights, const LatticeArray &nodes, int spacing,
          const OpticsArray &optics, const ProfileArray &profiles, double reach, const PositionArray &positions, const NumberArray &squares,
          const NumberArray &information, int most, bool move, double damping, double largest, double tolerance) {
    BoundDiscs bound(logs, nodes, spacing, optics, profiles, reach, positions, squares);
    require_same_shapes(logs, images, weights);
    bound.see(images, weights);
    require(damping > 0 && largest > 0 && tolerance >= 0, "sweeps: damping and largest positive, tolerance not negative");
    require(information.shape(0) == squares.shape(0), "discs: as many informations as squares, please");
    std::vector<uint8_t> awake(squares.shape(0));
    const DiscSweeps sweeps{most, move, damping, largest, tolerance, awake.data(), information.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return kernels.sweep_discs(bound.discs, sweeps);
}

void weigh(const Images &logs, const RecordedImages &images, const RecordedImages &weights, const LatticeArray &nodes, int spacing,
           const OpticsArray &optics, const ProfileArray &profiles, double reach, const PositionArray &positions, const NumberArray &squares,
           const SupportArray &out, int threads) {
    BoundDiscs bound(logs, nodes, spacing, optics, profiles, reach, positions, squares);
    require_same_shapes(logs, images, weights);
    bound.see(images, weights);
    require(out.shape(0) == bound.views.size() && out.shape(1) == squares.shape(0), "support: (views, discs, 10), please");
    static_assert(sizeof(DiscSupport) == 11 * sizeof(double), "a support is eleven numbers");
    require_threads(threads);
    auto *support = reinterpret_cast<DiscSupport *>(out.data());
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    for_each(bound.discs.n_views, threads,
             [&](int view) { kernels.weigh_discs(bound.discs, view, support + view * bound.discs.count); });
}

using CentreArray = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using RadiusArray = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

void covered(const CentreArray &centres, const RadiusArray &radii, const ImageArray &out) {
    require(centres.shape(0) == radii.shape(0), "discs: as many centres as radii, please");
    require(out.shape(0) % coverage_cells == 0 && out.shape(1) % coverage_cells == 0 && out.size() < (1u << 30),
            "cells: two per pixel along each axis, fewer than 2^30");
    nb::gil_scoped_release release;
    cover(centres.data(), radii.data(), static_cast<int64_t>(radii.shape(0)), out.data(),
          static_cast<int>(out.shape(0)) / coverage_cells, static_cast<int>(out.shape(1)) / coverage_cells);
}

}  // namespace

void bind_discs(nb::module_ &module) {
    module.attr("DISC_ROWS") = disc_rows;
    module.attr("DISC_NODES") = disc_nodes;
    module.attr("DISC_ROWS_PER_OCTAVE") = disc_rows_per_octave;
    module.attr("LEAST_BLUR_PX") = least_blur_px;
    module.attr("SMALLEST_DISC") = smallest_disc;
    module.attr("COVERAGE_CELLS") = coverage_cells;
    module.attr("LARGEST_DISC") = largest_disc;
    module.def("draw_discs", &draw, "log_transmissions"_a, "nodes"_a, "spacing"_a, "optics"_a, "profiles"_a, "reach"_a, "positions"_a,
               "squares"_a, "factor"_a, "threads"_a);
    module.def("sweep_discs", &sweep, "log_transmissions"_a, "images"_a, "weights"_a, "nodes"_a, "spacing"_a, "optics"_a,
               "profiles"_a, "reach"_a, "positions"_a, "squares"_a, "information"_a, "most"_a, "move"_a, "damping"_a, "largest"_a,
               "tolerance"_a);
    module.def("weigh_discs", &weigh, "log_transmissions"_a, "images"_a, "weights"_a, "nodes"_a, "spacing"_a, "optics"_a,
               "profiles"_a, "reach"_a, "positions"_a, "squares"_a, "out"_a, "threads"_a);
    module.def("cover", &covered, "centres"_a, "radii"_a, "out"_a);
}

}  // namespace tomoshadow
