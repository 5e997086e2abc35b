#include "host/block_maxima.hpp"

#include "binding/arrays.hpp"
#include "binding/bind.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

using SomeRows = nb::ndarray<nb::ndim<3>, nb::device::cpu, nb::ro>;  // of every plane of a volume

int blocks(int voxels, int factor) { return (voxels + factor - 1) / factor; }

void add_maxima(const SomeRows &slab, int first_row, int factor, const AnyVolume &maxima, int threads) {
    const Shape shape = shape_of(slab), grown = shape_of(maxima);
    require((shape.nx == 1 || slab.stride(2) == 1) && (shape.ny == 1 || slab.stride(1) == shape.nx),
            "slab: whole rows, side by side, please");
    require(slab.dtype() == maxima.dtype(), "slab and maxima must be of one type");
    require(first_row >= 0 && first_row < (1 << 30) && factor >= 1 && factor < (1 << 30), "first row or factor out of range");
    require(grown.nz == blocks(shape.nz, factor) && grown.nx == blocks(shape.nx, factor) &&
                grown.ny >= blocks(first_row + shape.ny, factor),
            "the maxima do not fit the slab");
    require_threads(threads);
    const BlockMaxima job{slab.data(), shape,    slab.stride(0), first_row,        factor,
                          maxima.data(), grown.ny, grown.nx,       format_of(maxima)};
    nb::gil_scoped_release release;
    add_block_maxima(job, threads);
}

}  // namespace

void bind_block_maxima(nb::module_ &module) {
    module.def("add_block_maxima", &add_maxima, "slab"_a.noconvert(), "first_row"_a, "factor"_a, "maxima"_a.noconvert(),
               "threads"_a);
}

}  // namespace tomoshadow
