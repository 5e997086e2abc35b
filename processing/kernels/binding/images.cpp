#include <nanobind/stl/optional.h>

#include <optional>
#include <string>

#include "binding/arrays.hpp"
#include "binding/bind.hpp"
#include "host/instruction_set.hpp"
#include "host/preprocess.hpp"
#include "host/resample.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

using MapArray = nb::ndarray<const float, nb::shape<-1, -1, 2>, nb::c_contig, nb::device::cpu>;
using AnyImage = nb::ndarray<nb::ndim<2>, nb::c_contig, nb::device::cpu, nb::ro>;

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
    require_threads(threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return quantise(kernels, from, before, after, out.data(), threads);
}

float resample_image(const RecordedArray &image, const MapArray &nodes, const FilledPixels &out, int threads) {
    constexpr int spacing = Resampling::node_spacing;
    const Recorded from = recorded(image);
    const int rows = static_cast<int>(out.shape(0)), columns = static_cast<int>(out.shape(1));
    if (columns % spacing || !rows)
        throw std::invalid_argument("resample: the output must have a multiple of " + std::to_string(spacing) + " columns");
    require(static_cast<int>(nodes.shape(0)) >= (rows - 1) / spacing + 2 &&
                static_cast<int>(nodes.shape(1)) >= columns / spacing + 1,
            "resample: the nodes do not cover the output");
    require_threads(threads);
    const Kernels &kernels = selected_kernels();
    nb::gil_scoped_release release;
    return resample(kernels, from, nodes.data(), static_cast<int>(nodes.shape(1)), out.data(), rows, columns, threads);
}

Exposure exposure_of(const AnyImage &pixels, int window, const ImageArray &out, int threads) {
    require(pixels.size() > 0 && pixels.size() < (1u << 30), "image: empty or too large");
    require(pixels.shape(0) == out.shape(0) && pixels.shape(1) == out.shape(1), "image and output differ in shape");
    require(window >= 0 && window <= (1 << 14), "window: 0 to 16384 pixels, please");
    require_threads(threads);
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
                         const std::optional<RecordedArray> &background, float full_scale, int window, float noise_floor,
                         const ImageArray &out, int threads) {
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

void bind_images(nb::module_ &module) {
    module.def("quantise", &quantise_framed, "image"_a, "before"_a, "after"_a, "out"_a, "threads"_a);
    module.def("resample", &resample_image, "image"_a, "nodes"_a, "out"_a, "threads"_a);
    module.def("preprocess", &preprocess_exposure, "pixels"_a, "dark"_a.none(), "background"_a.none(), "full_scale"_a,
               "window"_a, "noise_floor"_a, "out"_a.noconvert(), "threads"_a);
    module.def("sliding_minimum", &sliding_minimum_of, "image"_a, "window"_a, "out"_a.noconvert(), "threads"_a);
}

}  // namespace tomoshadow
