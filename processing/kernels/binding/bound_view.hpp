// BoundView: an image with its geometry, as Python holds it.
#pragma once

#include <nanobind/stl/vector.h>

#include <optional>
#include <vector>

#include "binding/arrays.hpp"
#include "host/occupancy.hpp"

namespace tomoshadow {

using PlaneArray = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NodeArray = nb::ndarray<const float, nb::shape<3, -1, -1, -1>, nb::c_contig, nb::device::cpu>;

using Foot = std::tuple<double, double, double>;  // column, row and distance, see Path

// An image with its geometry; owns references to the arrays.
class BoundView {
public:
    static BoundView rectified(PixelArray pixels, float unit, PlaneArray scale, PlaneArray shift_u, PlaneArray shift_v,
                               const Foot &foot, bool cull);
    static BoundView mapped(PixelArray pixels, float unit, NodeArray nodes, int spacing, bool cull);

    // The view, once it is certain that no voxel of the grid leads outside its arrays.
    const View &on(const Shape &shape) const;

private:
    BoundView(PixelArray pixels, float unit);
    void find_occupied();

    View view_{};
    PixelArray pixels_;
    std::vector<PlaneArray> planes_;
    std::optional<NodeArray> nodes_;
    OccupiedCells cells_;
};

std::vector<View> views_on(const std::vector<const BoundView *> &bound, const Shape &shape);

}  // namespace tomoshadow
