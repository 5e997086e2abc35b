#include "host/stamping.hpp"

#include <cmath>

#include "binding/arrays.hpp"
#include "binding/bind.hpp"

using namespace nanobind::literals;

namespace tomoshadow {

namespace {

constexpr int stamp_numbers = 10;
using StampArray = nb::ndarray<const double, nb::shape<-1, stamp_numbers>, nb::c_contig, nb::device::cpu>;

void check(const Stamp &stamp, const Profiles &profiles) {
    for (int axis = 0; axis < 3; ++axis)
        require(std::isfinite(stamp.centre[axis]) && std::isfinite(stamp.smear[axis]), "stamps: finite places, please");
    require(stamp.reach > 0 && std::isfinite(stamp.reach) && stamp.per_area > 0 && std::isfinite(stamp.per_area),
            "stamps: radii and blurs must be positive");
    require(stamp.opacity >= 0 && stamp.opacity <= 1, "stamps: opacities of 0 to 1, please");
    require(stamp.profile >= 0 && stamp.profile < profiles.rows, "stamps: a profile that the table does not have");
}

void stamp(const FloatVolume &volume, const StampArray &stamps, const RecordedArray &table, bool sampled_finely) {
    static_assert(sizeof(Stamp) == stamp_numbers * sizeof(double), "a stamp is ten numbers");
    const Shape shape = shape_of(volume);
    require(table.size() > 0 && table.shape(1) >= 2 && table.shape(1) <= (1 << 16), "profiles: 2 to 65536 columns, please");
    const Profiles profiles{table.data(), static_cast<int>(table.shape(0)), static_cast<int>(table.shape(1))};
    const auto *balls = reinterpret_cast<const Stamp *>(stamps.data());
    const auto count = static_cast<int64_t>(stamps.shape(0));
    for (int64_t n = 0; n < count; ++n) check(balls[n], profiles);
    nb::gil_scoped_release release;
    stamp_balls(volume.data(), shape, balls, count, profiles, sampled_finely);
}

}  // namespace

void bind_stamping(nb::module_ &module) {
    module.def("stamp", &stamp, "volume"_a.noconvert(), "stamps"_a, "profiles"_a, "sampled_finely"_a);
}

}  // namespace tomoshadow
