#include "host/smart.hpp"

#include <algorithm>
#include <string>

#include "binding/bind.hpp"
#include "binding/bound_view.hpp"
#include "host/instruction_set.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

Blocks blocks_of_views(const std::vector<const BoundView *> &bound, const Size &size, float exponent, float floor, float most,
                       int threads, Blocks *memory) {
    const Shape shape = volume_shape(size);
    require_threads(threads);
    const auto views = views_on(bound, shape);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return Blocks::of_views(kernels, views, shape, exponent, floor, most, threads, memory);
}

Blocks blocks_of_volume(const FloatVolume &volume, float most, int threads, Blocks *memory) {
    require_threads(threads);
    const Shape shape = shape_of(volume);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return Blocks::of_volume(kernels, volume.data(), shape, most, threads, memory);
}

void require_not_lent(const Blocks &blocks) { require(!blocks.lent(), "blocks: a later volume took their memory"); }

void write_blocks(const Blocks &blocks, const AnyVolume &volume, int threads, int first_row, float factor) {
    require_not_lent(blocks);
    const Shape shape = shape_of(volume), &stored = blocks.shape();
    require(shape.nz == stored.nz && shape.nx == stored.nx && shape.ny <= stored.ny, "volume: another shape than the blocks");
    require(first_row >= 0 && first_row <= stored.ny - shape.ny, "volume: more rows than the blocks");
    if (first_row % smart_rows)
        throw std::invalid_argument("volume: the first row must be a multiple of " + std::to_string(smart_rows));
    require_threads(threads);
    const Kernels &kernels = selected_kernels();
    const Format format = format_of(volume);
    nb::gil_scoped_release release;
    blocks.write(kernels, format, volume.data(), first_row, shape.ny, factor, threads);
}

// Projections that keep their views alive.
class BoundProjections {
public:
    BoundProjections(const std::vector<nb::object> &bound, const Size &size)
        : bound_(bound), projections_(views_of(bound, volume_shape(size)), volume_shape(size)) {}

    void pass(Blocks &blocks, const std::vector<bool> &update, const std::vector<bool> &project, int threads) {
        const Shape &shape = projections_.shape(), &other = blocks.shape();
        require_not_lent(blocks);
        require(shape.nz == other.nz && shape.ny == other.ny && shape.nx == other.nx,
                "projections: of another shape than the blocks");
        require(update.size() == bound_.size() && project.size() == bound_.size(), "two flags per view, please");
        const auto first = std::find(update.begin(), update.end(), true), end = std::find(first, update.end(), false);
        require(std::find(end, update.end(), true) == update.end(), "views to update must be neighbours");
        require_threads(threads);
        const Kernels &kernels = selected_kernels();
        nb::gil_scoped_release release;
        projections_.pass(kernels, blocks, update, project, threads);
    }

    double sum(int view) const { return projections_.sum(checked(view)); }

    double correct(int view, float unit, const PixelArray &recorded, float recorded_unit, float exponent, float ratio_counts,
                   const FilledPixels &ratio, int threads) const {
        const View &seen = projections_.views()[static_cast<size_t>(checked(view))];
        for (size_t axis : {0, 1}) {
            const auto size = static_cast<size_t>(axis ? seen.columns : seen.rows);
            require(recorded.shape(axis) == size && ratio.shape(axis) == size, "projections and images differ in shape");
        }
        require_threads(threads);
        const Correction job{{}, recorded.data(), recorded_unit, unit, exponent, ratio_counts, seen.rows,
                             seen.columns, nullptr, 0, ratio.data()};
        const Kernels &kernels = selected_kernels();
        nb::gil_scoped_release release;
        return projections_.correct(kernels, view, job, threads);
    }

private:
    int checked(int view) const {
        require(view >= 0 && view < static_cast<int>(bound_.size()), "no such view");
        return view;
    }
    static std::vector<View> views_of(const std::vector<nb::object> &bound, const Shape &shape) {
        std::vector<const BoundView *> views;
        for (const nb::object &view : bound) views.push_back(nb::cast<const BoundView *>(view));
        return views_on(views, shape);
    }

    std::vector<nb::object> bound_;
    Projections projections_;
};

}  // namespace

void bind_smart(nb::module_ &module) {
    nb::class_<Blocks>(module, "Blocks")
        .def_static("of_views", &blocks_of_views, "views"_a, "shape"_a, "exponent"_a, "floor"_a, "most"_a, "threads"_a,
                    "memory"_a = nb::none())
        .def_static("of_volume", &blocks_of_volume, "volume"_a, "most"_a, "threads"_a, "memory"_a = nb::none())
        .def("scale", &Blocks::scale, "factor"_a)
        .def_prop_ro("unit", &Blocks::unit)
        .def("write", &write_blocks, "volume"_a, "threads"_a, "first_row"_a = 0, "factor"_a = 1.0f)
        .def_prop_ro("shape", [](const Blocks &blocks) {
            return Size(blocks.shape().nz, blocks.shape().ny, blocks.shape().nx);
        })
        .def_prop_ro("nbytes", &Blocks::bytes)
        .def_prop_ro("count", &Blocks::count);
    nb::class_<BoundProjections>(module, "Projections")
        .def(nb::init<const std::vector<nb::object> &, const Size &>(), "views"_a, "shape"_a)
        .def("smart_pass", &BoundProjections::pass, "blocks"_a, "update"_a, "project"_a, "threads"_a)
        .def("sum", &BoundProjections::sum, "view"_a)
        .def("correct", &BoundProjections::correct, "view"_a, "unit"_a, "recorded"_a, "recorded_unit"_a, "exponent"_a,
             "ratio_counts"_a, "ratio"_a, "threads"_a);
}

}  // namespace tomoshadow
