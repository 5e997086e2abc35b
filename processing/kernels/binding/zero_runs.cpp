#include "host/zero_runs.hpp"

#include <memory>

#include "binding/arrays.hpp"
#include "binding/bind.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

nb::bytes pack(const RecordedArray &numbers, uint32_t adler) {
    static_assert(sizeof(float) == sizeof(uint32_t), "numbers are words");
    const size_t count = numbers.size();
    const std::unique_ptr<uint8_t[]> packed(new uint8_t[most_packed_bytes(count)]);
    size_t bytes = 0;
    {
        nb::gil_scoped_release release;
        bytes = pack_zero_runs(reinterpret_cast<const uint32_t *>(numbers.data()), count, adler, packed.get());
    }
    return nb::bytes(packed.get(), bytes);
}

}  // namespace

void bind_zero_runs(nb::module_ &module) { module.def("pack_zero_runs", &pack, "numbers"_a, "adler"_a); }

}  // namespace tomoshadow
