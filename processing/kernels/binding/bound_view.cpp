#include "binding/bound_view.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

namespace tomoshadow {

namespace {

int last_of_blocks(int nx) { return (nx + block_columns - 1) / block_columns * block_columns - 1; }

}  // namespace

BoundView::BoundView(PixelArray pixels, float unit) : pixels_(std::move(pixels)) {
    require(pixels_.shape(0) >= 3 && pixels_.shape(1) >= 3 && pixels_.size() < (1u << 30), "view: image too small or too large");
    view_.pixels = pixels_.data();
    view_.rows = static_cast<int>(pixels_.shape(0));
    view_.columns = static_cast<int>(pixels_.shape(1));
    view_.unit = unit;
}

BoundView BoundView::rectified(PixelArray pixels, float unit, PlaneArray scale, PlaneArray shift_u, PlaneArray shift_v,
                               const Foot &foot, bool cull) {
    require(scale.shape(0) == shift_u.shape(0) && scale.shape(0) == shift_v.shape(0),
            "rectified view: scale and shifts differ in length");
    BoundView bound(std::move(pixels), unit);
    bound.planes_ = {std::move(scale), std::move(shift_u), std::move(shift_v)};
    bound.view_.scale = bound.planes_[0].data();
    bound.view_.shift_u = bound.planes_[1].data();
    bound.view_.shift_v = bound.planes_[2].data();
    const auto [foot_u, foot_v, distance] = foot;
    require(distance > 0, "rectified view: its distance must be positive");
    bound.view_.path = {static_cast<float>(foot_u), static_cast<float>(foot_v), static_cast<float>(1 / distance)};
    if (cull) bound.find_occupied();
    return bound;
}

BoundView BoundView::mapped(PixelArray pixels, float unit, NodeArray nodes, int spacing, bool cull) {
    require(std::find(std::begin(node_spacings), std::end(node_spacings), spacing) != std::end(node_spacings),
            "nodes: no such spacing, see NODE_SPACINGS");
    BoundView bound(std::move(pixels), unit);
    bound.view_.nodes = nodes.data();
    bound.view_.nodes_z = static_cast<int>(nodes.shape(1));
    bound.view_.nodes_y = static_cast<int>(nodes.shape(2));
    bound.view_.nodes_x = static_cast<int>(nodes.shape(3));
    bound.view_.spacing = spacing;
    bound.nodes_ = std::move(nodes);
    if (cull) bound.find_occupied();
    return bound;
}

const View &BoundView::on(const Shape &shape) const {
    if (view_.nodes) {
        const int s = view_.spacing;
        require(view_.nodes_z >= (shape.nz - 1) / s + 2 && view_.nodes_y >= (shape.ny - 1) / s + 2 &&
                    view_.nodes_x >= (shape.nx - 1) / s + 2,
                "nodes: they do not cover the volume");
        return view_;
    }
    require(planes_[0].shape(0) == static_cast<size_t>(shape.nz), "rectified view: one scale per plane, please");
    for (int z = 0; z < shape.nz; ++z) {
        const double scale = view_.scale[z], u = view_.shift_u[z], v = view_.shift_v[z];
        require(scale >= 1 / max_scale && scale <= max_scale, "rectified view: scale outside 0.56 .. 1.8 pixels per voxel");
        require(u >= 0 && v >= 0 && std::floor(scale * last_of_blocks(shape.nx) + u) + overhang_columns <= view_.columns &&
                    std::floor(scale * (shape.ny - 1) + v) + overhang_rows <= view_.rows,
                "rectified view: the image does not cover the volume");
    }
    return view_;
}

void BoundView::find_occupied() {
    cells_ = occupied_cells(view_.pixels, view_.rows, view_.columns);
    view_.occupancy = {cells_.sums.data(), cells_.columns};
}

std::vector<View> views_on(const std::vector<const BoundView *> &bound, const Shape &shape) {
    if (bound.empty() || bound.size() > max_views)
        throw std::invalid_argument("1 to " + std::to_string(max_views) + " views, please");
    std::vector<View> views;
    for (const BoundView *view : bound) views.push_back(view->on(shape));
    return views;
}

}  // namespace tomoshadow
