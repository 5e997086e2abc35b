// Python binding: checks everything the kernels rely on, holds every buffer they read, releases the GIL.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>

#include "host/smart.hpp"
#include "host/blocks.hpp"
#include "host/resample.hpp"
#include "host/instruction_set.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tomoshadow;

namespace {

using PixelArray = nb::ndarray<const int16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FilledPixels = nb::ndarray<int16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using RecordedArray = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using MapArray = nb::ndarray<const float, nb::shape<-1, -1, 2>, nb::c_contig, nb::device::cpu>;
using PlaneArray = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NodeArray = nb::ndarray<const float, nb::shape<3, -1, -1, -1>, nb::c_contig, nb::device::cpu>;
using ImageArray = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FloatVolume = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using AnyImage = nb::ndarray<nb::ndim<2>, nb::c_contig, nb::device::cpu, nb::ro>;
using AnyVolume = nb::ndarray<nb::ndim<3>, nb::c_contig, nb::device::cpu>;

constexpr int max_views = 8;
constexpr int overhang = 33;          // columns the widest vector may read beyond the last voxel of a block
constexpr double max_scale = 1.8;     // pixels per voxel, see lanes.hpp
constexpr double min_scale = 1 / 1.8;

void require(bool condition, const char *what) {
    if (!condition) throw std::invalid_argument(what);
}

// An image with its geometry; owns references to the arrays.
class BoundView {
public:
    static BoundView rectified(PixelArray pixels, float unit, PlaneArray scale, PlaneArray shift_u, PlaneArray shift_v,
                               bool cull) {
        require(scale.shape(0) == shift_u.shape(0) && scale.shape(0) == shift_v.shape(0),
                "rectified view: scale and shifts differ in length");
        BoundView bound(std::move(pixels), unit);
        bound.planes_ = {std::move(scale), std::move(shift_u), std::move(shift_v)};
        bound.view_.scale = bound.planes_[0].data();
        bound.view_.shift_u = bound.planes_[1].data();
        bound.view_.shift_v = bound.planes_[2].data();
        if (cull) bound.find_occupied();
        return bound;
    }

    static BoundView mapped(PixelArray pixels, float unit, NodeArray nodes, int spacing, bool cull) {
        require(spacing == 16 || spacing == 8 || spacing == 4 || spacing == 2, "nodes: spacing must be 2, 4, 8 or 16");
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

    // The view, once it is certain that no voxel of the grid leads outside its arrays.
    const View &on(const Shape &shape) const {
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
            require(scale >= min_scale && scale <= max_scale, "rectified view: scale outside 0.56 .. 1.8 pixels per voxel");
            require(u >= 0 && v >= 0 && scale * (last_of_blocks(shape.nx)) + u + overhang < view_.columns &&
                        scale * (shape.ny - 1) + v + 2 < view_.rows,
                    "rectified view: the image does not cover the volume");
        }
        return view_;
    }

private:
    BoundView(PixelArray pixels, float unit) : pixels_(std::move(pixels)) {
        require(pixels_.shape(0) >= 3 && pixels_.shape(1) >= 3 && pixels_.size() < (1u << 30),
                "view: image too small or too large");
        view_.pixels = pixels_.data();
        view_.rows = static_cast<int>(pixels_.shape(0));
        view_.columns = static_cast<int>(pixels_.shape(1));
        view_.unit = unit;
    }

    static int last_of_blocks(int nx) { return (nx + block_columns - 1) / block_columns * block_columns - 1; }

    void find_occupied() {
        cells_ = occupied_cells(view_.pixels, view_.rows, view_.columns);
        view_.occupancy = {cells_.sums.data(), cells_.columns};
    }

    View view_{};
    PixelArray pixels_;
    std::vector<PlaneArray> planes_;
    std::optional<NodeArray> nodes_;
    OccupiedCells cells_;
};

std::vector<View> views_on(const std::vector<const BoundView *> &bound, const Shape &shape, int threads) {
    require(!bound.empty() && bound.size() <= max_views, "1 to 8 views, please");
    require(threads >= 1, "threads must be positive");
    std::vector<View> views;
    for (const BoundView *view : bound) views.push_back(view->on(shape));
    return views;
}

// Kernels look up once where the views of all exposures see a voxel.
bool same_geometry(const View &a, const View &b) {
    return a.rows == b.rows && a.columns == b.columns && a.scale == b.scale && a.shift_u == b.shift_u &&
           a.shift_v == b.shift_v && a.nodes == b.nodes && a.spacing == b.spacing;
}

template <class Array>
Shape shape_of(const Array &volume) {
    require(volume.size() > 0, "volume: empty");
    return {static_cast<int>(volume.shape(0)), static_cast<int>(volume.shape(1)), static_cast<int>(volume.shape(2))};
}

Shape volume_shape(std::tuple<int, int, int> size) {
    const Shape shape{std::get<0>(size), std::get<1>(size), std::get<2>(size)};
    require(shape.nz > 0 && shape.ny > 0 && shape.nx > 0, "volume: empty");
    return shape;
}

Format format_of(const AnyVolume &volume) {
    if (volume.dtype() == nb::dtype<float>()) return Format::single;
    if (volume.dtype() == nb::dtype<uint8_t>()) return Format::byte;
    const nb::dlpack::dtype half{static_cast<uint8_t>(nb::dlpack::dtype_code::Float), 16, 1};
    require(volume.dtype() == half, "volume: float32, float16 or uint8, please");
    return Format::half;
}

Method method_of(int number) {
    require(number >= 0 && number <= 2, "method must be 0, 1 or 2");
    return static_cast<Method>(number);
}

void line_of_sight(const std::vector<const BoundView *> &bound, int method, const AnyVolume &volume, int threads,
                   int first_row, int grid_rows) {
    const Shape shape = shape_of(volume);
    if (!grid_rows) grid_rows = shape.ny;
    require(first_row >= 0 && first_row <= grid_rows - shape.ny, "volume: more rows than the grid");
    const auto views = views_on(bound, {shape.nz, grid_rows, shape.nx}, threads);
    const LineOfSight job{views.data(), static_cast<int>(views.size()), shape, first_row, method_of(method),
                          format_of(volume), volume.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    run_line_of_sight(kernels, job, threads);
}

void sum_of_sight(const std::vector<std::vector<const BoundView *>> &exposures, int method, const FloatVolume &volume,
                  int threads) {
    const Shape shape = shape_of(volume);
    require(!exposures.empty(), "one exposure or more, please");
    std::vector<View> views;
    for (const auto &bound : exposures) {
        require(bound.size() == exposures[0].size(), "exposures differ in their number of views");
        for (const View &view : views_on(bound, shape, threads)) {
            require(same_geometry(view, views.size() < bound.size() ? view : views[views.size() % bound.size()]),
                    "exposures must be of the same views");
            views.push_back(view);
        }
    }
    const SumOfSight job{views.data(), static_cast<int>(exposures[0].size()), static_cast<int>(exposures.size()),
                         shape,        method_of(method),                      volume.data()};
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    run_sum_of_sight(kernels, job, threads);
}

Blocks blocks_of_views(const std::vector<const BoundView *> &bound, std::tuple<int, int, int> size, float exponent,
                       float floor, float most, int threads, Blocks *memory) {
    const Shape shape = volume_shape(size);
    const auto views = views_on(bound, shape, threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return Blocks::of_views(kernels, views, shape, exponent, floor, most, threads, memory);
}

Blocks blocks_of_volume(const FloatVolume &volume, float most, int threads, Blocks *memory) {
    require(threads >= 1, "threads must be positive");
    const Shape shape = shape_of(volume);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return Blocks::of_volume(kernels, volume.data(), shape, most, threads, memory);
}

// What blocks look like from some views, whose images hold the ratios; keeps the views alive.
class Projections {
public:
    Projections(const std::vector<nb::object> &bound, std::tuple<int, int, int> size)
        : shape_(volume_shape(size)), bound_(bound), views_(views_of(bound, shape_)), images_(views_, shape_) {}

    void pass(Blocks &blocks, const std::vector<bool> &update, const std::vector<bool> &project, int threads) {
        const Shape &other = blocks.shape();
        require(shape_.nz == other.nz && shape_.ny == other.ny && shape_.nx == other.nx,
                "projections: of another shape than the blocks");
        require(update.size() == views_.size() && project.size() == views_.size(), "two flags per view, please");
        const auto first = std::find(update.begin(), update.end(), true), end = std::find(first, update.end(), false);
        require(std::find(end, update.end(), true) == update.end(), "views to update must be neighbours");
        require(threads >= 1, "threads must be positive");
        const Kernels &kernels = selected_kernels();
        nb::gil_scoped_release release;
        blocks.pass(kernels, views_, update, project, images_, threads);
    }

    double sum(int view) const { return images_.sum(checked(view)); }

    double correct(int view, float unit, const PixelArray &recorded, float recorded_unit, float exponent,
                   float ratio_counts, const FilledPixels &ratio, int threads) const {
        const View &seen = views_[static_cast<size_t>(checked(view))];
        for (size_t axis : {0, 1}) {
            const auto size = static_cast<size_t>(axis ? seen.columns : seen.rows);
            require(recorded.shape(axis) == size && ratio.shape(axis) == size, "projections and images differ in shape");
        }
        require(threads >= 1, "threads must be positive");
        const Correction job{recorded.data(), recorded_unit, unit, exponent, ratio_counts, seen.rows,
                             seen.columns, nullptr, 0, ratio.data()};
        const Kernels &kernels = selected_kernels();
        nb::gil_scoped_release release;
        return images_.correct(kernels, view, job, threads);
    }

private:
    int checked(int view) const {
        require(view >= 0 && view < static_cast<int>(views_.size()), "no such view");
        return view;
    }
    static std::vector<View> views_of(const std::vector<nb::object> &bound, const Shape &shape) {
        std::vector<const BoundView *> views;
        for (const nb::object &view : bound) views.push_back(nb::cast<const BoundView *>(view));
        return views_on(views, shape, 1);
    }

    Shape shape_;
    std::vector<nb::object> bound_;
    std::vector<View> views_;
    BandImages images_;
};

void fill_volume(Blocks &blocks, const AnyVolume &volume, int threads, int first_row) {
    const Shape shape = shape_of(volume), &stored = blocks.shape();
    require(shape.nz == stored.nz && shape.nx == stored.nx && shape.ny <= stored.ny, "volume: another shape than the blocks");
    require(first_row >= 0 && first_row <= stored.ny - shape.ny, "volume: more rows than the blocks");
    require(first_row % smart_rows == 0, "volume: the first row must be a multiple of 8");
    require(threads >= 1, "threads must be positive");
    const Kernels &kernels = selected_kernels();
    const Format format = format_of(volume);
    nb::gil_scoped_release release;
    blocks.write(kernels, format, volume.data(), first_row, shape.ny, threads);
}

Recorded recorded(const RecordedArray &image) {
    require(image.size() > 0 && image.size() < (1u << 30), "image: empty or too large");
    const int rows = static_cast<int>(image.shape(0)), columns = static_cast<int>(image.shape(1));
    return {image.data(), rows, columns, columns};
}

float quantise_framed(const RecordedArray &image, int before, int after, const FilledPixels &out, int threads) {
    const Recorded from = recorded(image);
    require(before >= 0 && after >= 0 && static_cast<int64_t>(out.shape(0)) == from.rows + before + after &&
                static_cast<int64_t>(out.shape(1)) == from.columns + before + after,
            "quantise: image and frame do not fill the output");
    require(threads >= 1, "threads must be positive");
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return quantise(kernels, from, before, after, out.data(), threads);
}

float resample_image(const RecordedArray &image, const MapArray &nodes, const FilledPixels &out, int threads) {
    constexpr int spacing = Resampling::node_spacing;
    const Recorded from = recorded(image);
    const int rows = static_cast<int>(out.shape(0)), columns = static_cast<int>(out.shape(1));
    require(columns % spacing == 0 && rows > 0, "resample: the output must have a multiple of 16 columns");
    require(static_cast<int>(nodes.shape(0)) >= (rows - 1) / spacing + 2 &&
                static_cast<int>(nodes.shape(1)) >= columns / spacing + 1,
            "resample: the nodes do not cover the output");
    require(threads >= 1, "threads must be positive");
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return resample(kernels, from, nodes.data(), static_cast<int>(nodes.shape(1)), out.data(), rows, columns, threads);
}

Exposure exposure_of(const AnyImage &pixels, int window, const ImageArray &out, int threads) {
    require(pixels.size() > 0 && pixels.size() < (1u << 30), "image: empty or too large");
    require(pixels.shape(0) == out.shape(0) && pixels.shape(1) == out.shape(1), "image and output differ in shape");
    require(window >= 0 && window <= (1 << 14), "window: 0 to 16384 pixels, please");
    require(threads >= 1, "threads must be positive");
    Exposure exposure{};
    exposure.pixels = pixels.data();
    exposure.grey = pixels.dtype() == nb::dtype<uint8_t>()    ? Exposure::Grey::byte
                    : pixels.dtype() == nb::dtype<uint16_t>() ? Exposure::Grey::word
                                                              : Exposure::Grey::single;
    require(exposure.grey != Exposure::Grey::single || pixels.dtype() == nb::dtype<float>(),
            "image: uint8, uint16 or float32, please");
    exposure.rows = static_cast<int>(pixels.shape(0));
    exposure.columns = static_cast<int>(pixels.shape(1));
    exposure.full_scale = 1.0f;
    exposure.window = window;
    exposure.intensity = out.data();
    return exposure;
}

const float *reference(const std::optional<RecordedArray> &image, const ImageArray &out) {
    if (!image) return nullptr;
    require(image->shape(0) == out.shape(0) && image->shape(1) == out.shape(1), "image and reference differ in shape");
    return image->data();
}

void preprocess_exposure(const AnyImage &pixels, const std::optional<RecordedArray> &dark,
                         const std::optional<RecordedArray> &background, float full_scale, int window,
                         float noise_floor, const ImageArray &out, int threads) {
    require(full_scale > 0 && noise_floor >= 0 && noise_floor < 1, "full scale or noise floor out of range");
    Exposure exposure = exposure_of(pixels, window, out, threads);
    exposure.dark = reference(dark, out);
    exposure.background = reference(background, out);
    exposure.full_scale = full_scale;
    exposure.noise_floor = noise_floor;
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    preprocess(kernels, exposure, threads);
}

void sliding_minimum_of(const RecordedArray &image, int window, const ImageArray &out, int threads) {
    require(window >= 1, "window must be positive");
    const Exposure exposure = exposure_of(AnyImage(image), window, out, threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    sliding_minimum(kernels, exposure, threads);
}

}  // namespace

NB_MODULE(_native, module) {
    nb::class_<BoundView>(module, "View")
        .def_static("rectified", &BoundView::rectified, "pixels"_a, "unit"_a, "scale"_a, "shift_u"_a,
                    "shift_v"_a, "cull"_a = true)
        .def_static("mapped", &BoundView::mapped, "pixels"_a, "unit"_a, "nodes"_a, "spacing"_a,
                    "cull"_a = true);
    module.def("quantise", &quantise_framed, "image"_a, "before"_a, "after"_a, "out"_a, "threads"_a);
    module.def("resample", &resample_image, "image"_a, "nodes"_a, "out"_a, "threads"_a);
    module.def("preprocess", &preprocess_exposure, "pixels"_a, "dark"_a.none(), "background"_a.none(), "full_scale"_a,
               "window"_a, "noise_floor"_a, "out"_a.noconvert(), "threads"_a);
    module.def("sliding_minimum", &sliding_minimum_of, "image"_a, "window"_a, "out"_a.noconvert(), "threads"_a);
    module.def("line_of_sight", &line_of_sight, "views"_a, "method"_a, "volume"_a, "threads"_a,
               "first_row"_a = 0, "grid_rows"_a = 0);
    module.def("sum_of_sight", &sum_of_sight, "exposures"_a, "method"_a, "volume"_a, "threads"_a);
    nb::class_<Blocks>(module, "Blocks")
        .def_static("of_views", &blocks_of_views, "views"_a, "shape"_a, "exponent"_a, "floor"_a, "most"_a,
                    "threads"_a, "memory"_a = nb::none())
        .def_static("of_volume", &blocks_of_volume, "volume"_a, "most"_a, "threads"_a, "memory"_a = nb::none())
        .def("scale", &Blocks::scale, "factor"_a)
        .def_prop_ro("unit", &Blocks::unit)
        .def("write", &fill_volume, "volume"_a, "threads"_a, "first_row"_a = 0)
        .def_prop_ro("shape", [](const Blocks &blocks) {
            return std::make_tuple(blocks.shape().nz, blocks.shape().ny, blocks.shape().nx);
        })
        .def_prop_ro("nbytes", &Blocks::bytes)
        .def_prop_ro("count", &Blocks::count);
    nb::class_<Projections>(module, "Projections")
        .def(nb::init<const std::vector<nb::object> &, std::tuple<int, int, int>>(), "views"_a, "shape"_a)
        .def("smart_pass", &Projections::pass, "blocks"_a, "update"_a, "project"_a, "threads"_a)
        .def("sum", &Projections::sum, "view"_a)
        .def("correct", &Projections::correct, "view"_a, "unit"_a, "recorded"_a, "recorded_unit"_a, "exponent"_a,
             "ratio_counts"_a, "ratio"_a, "threads"_a);
    module.def("available_isas", &available_isas);
    module.def("selected_isa", [] { return std::string(selected_kernels().name); });
}
