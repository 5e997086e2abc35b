#include "host/line_of_sight.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include "binding/bind.hpp"
#include "binding/bound_view.hpp"
#include "host/instruction_set.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

struct NamedMethod {
    const char *name;
    Method method;
};
constexpr NamedMethod methods[] = {{"gavlos", Method::geometric_mean}, {"minlos", Method::minimum}, {"mlos", Method::product}};

Method method_of(const std::string &name) {
    for (const NamedMethod &named : methods)
        if (named.name == name) return named.method;
    throw std::invalid_argument(name + " is not a line-of-sight method, see METHODS");
}

// Kernels look up once where the views of all exposures see a voxel.
bool same_geometry(const View &a, const View &b) {
    return a.rows == b.rows && a.columns == b.columns && a.scale == b.scale && a.shift_u == b.shift_u &&
           a.shift_v == b.shift_v && a.nodes == b.nodes && a.spacing == b.spacing;
}

// The grid of which a volume has the rows and columns from a corner on; without their numbers the volume has all of them.
Shape grid_of(const Shape &shape, const Corner &first, int rows, int columns) {
    if (!rows) rows = shape.ny;
    if (!columns) columns = shape.nx;
    require(first.row >= 0 && first.row <= rows - shape.ny, "volume: more rows than the grid");
    require(first.column >= 0 && first.column <= columns - shape.nx, "volume: more columns than the grid");
    require(first.column % block_columns == 0, "volume: its first column is in the middle of a block");
    return {shape.nz, rows, columns};
}

void line_of_sight(const std::vector<const BoundView *> &bound, const std::string &method, const AnyVolume &volume, int threads,
                   int first_row, int grid_rows, int first_column, int grid_columns) {
    const Shape shape = shape_of(volume);
    const Corner first{first_row, first_column};
    require_threads(threads);
    const auto views = views_on(bound, grid_of(shape, first, grid_rows, grid_columns));
    const LineOfSight job{views.data(),      static_cast<int>(views.size()), shape, first, method_of(method),
                          format_of(volume), volume.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    run_line_of_sight(kernels, job, threads);
}

void sum_of_sight(const std::vector<std::vector<const BoundView *>> &exposures, const std::string &method,
                  const FloatVolume &volume, int threads, int first_row, int grid_rows, int first_column,
                  int grid_columns, bool mean) {
    const Corner first{first_row, first_column};
    const Shape shape = shape_of(volume), grid = grid_of(shape, first, grid_rows, grid_columns);
    require(!exposures.empty(), "one exposure or more, please");
    require_threads(threads);
    std::vector<View> views;
    for (const auto &bound : exposures) {
        require(bound.size() == exposures[0].size(), "exposures differ in their number of views");
        for (const View &view : views_on(bound, grid)) {
            require(same_geometry(view, views.size() < bound.size() ? view : views[views.size() % bound.size()]),
                    "exposures must be of the same views");
            views.push_back(view);
        }
    }
    const SumOfSight job{views.data(), static_cast<int>(exposures[0].size()), static_cast<int>(exposures.size()),
                         shape,        first,                                  method_of(method),
                         mean,         volume.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    run_sum_of_sight(kernels, job, threads);
}

}  // namespace

void bind_line_of_sight(nb::module_ &module) {
    nb::list names;
    for (const NamedMethod &named : methods) names.append(named.name);
    module.attr("METHODS") = nb::tuple(names);
    nb::class_<BoundView>(module, "View")
        .def_static("rectified", &BoundView::rectified, "pixels"_a, "unit"_a, "scale"_a, "shift_u"_a, "shift_v"_a,
                    "foot"_a, "cull"_a = true)
        .def_static("mapped", &BoundView::mapped, "pixels"_a, "unit"_a, "nodes"_a, "spacing"_a, "cull"_a = true);
    module.def("line_of_sight", &line_of_sight, "views"_a, "method"_a, "volume"_a, "threads"_a, "first_row"_a = 0,
               "grid_rows"_a = 0, "first_column"_a = 0, "grid_columns"_a = 0);
    module.def("sum_of_sight", &sum_of_sight, "exposures"_a, "method"_a, "volume"_a, "threads"_a, "first_row"_a = 0,
               "grid_rows"_a = 0, "first_column"_a = 0, "grid_columns"_a = 0, "mean"_a = false);
}

}  // namespace tomoshadow
