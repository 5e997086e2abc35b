// Arrays as the binding takes them, and what it demands of them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <stdexcept>
#include <tuple>

#include "job.hpp"

namespace tomoshadow {

namespace nb = nanobind;

using PixelArray = nb::ndarray<const int16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FilledPixels = nb::ndarray<int16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using RecordedArray = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ImageArray = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FloatVolume = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using AnyVolume = nb::ndarray<nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using LatticeArray = nb::ndarray<const double, nb::shape<-1, -1, -1, -1, 2>, nb::c_contig, nb::device::cpu>;
using PositionArray = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NumberArray = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Size = std::tuple<int, int, int>;  // (nz, ny, nx)

inline void require(bool condition, const char *what) {
    if (!condition) throw std::invalid_argument(what);
}

inline void require_threads(int threads) { require(threads >= 1, "threads must be positive"); }

inline NodeGrid node_grid(const LatticeArray &nodes, int spacing) {
    require(nodes.shape(1) >= 2 && nodes.shape(2) >= 2 && nodes.shape(3) >= 2 && spacing >= 1,
            "nodes: two or more along each axis");
    return {static_cast<int>(nodes.shape(1)), static_cast<int>(nodes.shape(2)), static_cast<int>(nodes.shape(3)), spacing};
}

inline Shape volume_shape(const Size &size) {
    const Shape shape{std::get<0>(size), std::get<1>(size), std::get<2>(size)};
    require(shape.nz > 0 && shape.ny > 0 && shape.nx > 0, "volume: empty");
    return shape;
}

template <class Array>
Shape shape_of(const Array &volume) {
    return volume_shape({static_cast<int>(volume.shape(0)), static_cast<int>(volume.shape(1)), static_cast<int>(volume.shape(2))});
}

inline Format format_of(const AnyVolume &volume) {
    if (volume.dtype() == nb::dtype<float>()) return Format::single;
    if (volume.dtype() == nb::dtype<uint8_t>()) return Format::byte;
    const nb::dlpack::dtype half{static_cast<uint8_t>(nb::dlpack::dtype_code::Float), 16, 1};
    require(volume.dtype() == half, "volume: float32, float16 or uint8, please");
    return Format::half;
}

}  // namespace tomoshadow
