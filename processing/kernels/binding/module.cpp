// The Python module.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "binding/bind.hpp"
#include "host/instruction_set.hpp"

namespace nb = nanobind;
using namespace tomoshadow;

NB_MODULE(_native, module) {
    bind_images(module);
    bind_line_of_sight(module);
    bind_smart(module);
    module.def("available_isas", &available_isas);
    module.def("selected_isa", [] { return std::string(selected_kernels().name); });
}
