// The kernels of each instruction set, and the choice among them.
#pragma once

#include <string>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

namespace plain {
extern const Kernels kernels;
}
#if defined(__x86_64__)
namespace avx2 {
extern const Kernels kernels;
}
namespace avx512 {
extern const Kernels kernels;
}
#endif

// Names of the sets that this processor runs, slowest first.
std::vector<std::string> available_isas();

// The set named by the environment variable TOMOSHADOW_ISA, else the fastest one.
// Throws std::invalid_argument where this processor does not run the named set.
const Kernels &selected_kernels();

}  // namespace tomoshadow
