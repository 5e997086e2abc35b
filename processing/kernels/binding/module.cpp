// The Python module: its parts, and the limits that planning has to keep.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "binding/bind.hpp"
#include "host/instruction_set.hpp"

namespace nb = nanobind;
using namespace tomoshadow;

NB_MODULE(_native, module) {
    module.attr("MAX_VIEWS") = max_views;
    module.attr("BLOCK_COLUMNS") = block_columns;
    module.attr("BLOCK_ROWS") = smart_rows;
    module.attr("OVERHANG_COLUMNS") = overhang_columns;
    module.attr("OVERHANG_ROWS") = overhang_rows;
    module.attr("MAP_SPACING_PX") = Resampling::node_spacing;
    nb::list spacings;
    for (const int spacing : node_spacings) spacings.append(spacing);
    module.attr("NODE_SPACINGS") = nb::tuple(spacings);
    bind_blobs(module);
    bind_block_maxima(module);
    bind_discs(module);
    bind_images(module);
    bind_line_of_sight(module);
    bind_smart(module);
    bind_stamping(module);
    bind_zero_runs(module);
    module.def("available_isas", &available_isas);
    module.def("selected_isa", [] { return std::string(selected_kernels().name); });
}
