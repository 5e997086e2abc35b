#include "host/instruction_set.hpp"

#include <cstdlib>
#include <stdexcept>

namespace tomoshadow {

namespace {

std::vector<const Kernels *> supported_kernels() {
    std::vector<const Kernels *> found{&plain::kernels};
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
        found.push_back(&avx2::kernels);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512cd"))
        found.push_back(&avx512::kernels);
#endif
    return found;
}

}  // namespace

std::vector<std::string> available_isas() {
    std::vector<std::string> names;
    for (const Kernels *kernels : supported_kernels()) names.emplace_back(kernels->name);
    return names;
}

const Kernels &selected_kernels() {
    const auto supported = supported_kernels();
    const char *wanted = std::getenv("TOMOSHADOW_ISA");
    if (!wanted || !*wanted) return *supported.back();
    for (const Kernels *kernels : supported)
        if (std::string(kernels->name) == wanted) return *kernels;
    std::string known;
    for (const Kernels *kernels : supported) known += std::string(known.empty() ? "" : ", ") + kernels->name;
    throw std::invalid_argument("TOMOSHADOW_ISA is " + std::string(wanted) + ", this processor runs " + known);
}

}  // namespace tomoshadow
