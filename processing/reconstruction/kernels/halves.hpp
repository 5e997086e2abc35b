// Voxels of SMART in memory: float16, gradual underflow included, with any instruction set.
#pragma once

#include "lanes.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

constexpr float largest_half = 65504.0f;

#if defined(__AVX512F__)

inline Floats load_halves(const uint16_t *from) {
    return reinterpret_cast<Floats>(_mm512_cvtph_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i *>(from))));
}
inline void store_half_lanes(uint16_t *to, Floats values) {
    _mm256_storeu_si256(reinterpret_cast<__m256i *>(to),
                        _mm512_cvtps_ph(reinterpret_cast<__m512>(values), _MM_FROUND_TO_NEAREST_INT));
}

#elif defined(__F16C__)

inline Floats load_halves(const uint16_t *from) {
    return reinterpret_cast<Floats>(_mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i *>(from))));
}
inline void store_half_lanes(uint16_t *to, Floats values) {
    _mm_storeu_si128(reinterpret_cast<__m128i *>(to),
                     _mm256_cvtps_ph(reinterpret_cast<__m256>(values), _MM_FROUND_TO_NEAREST_INT));
}

#else

// By integers, since subnormal floats count as zero here. Values are not negative.
typedef uint16_t HalfLanes __attribute__((vector_size(2 * lanes)));
constexpr int exponent_shift = (127 - 15) << 10;
constexpr float subnormal_unit = 1.0f / (1 << 24), least_normal = 1.0f / (1 << 14);

inline Floats load_halves(const uint16_t *from) {
    const Ints bits = __builtin_convertvector(load<HalfLanes>(from), Ints);
    const Ints normal = (bits + exponent_shift) << 13;
    Floats value;
    std::memcpy(&value, &normal, sizeof value);
    return bits < 0x400 ? __builtin_convertvector(bits, Floats) * subnormal_unit : value;
}
inline void store_half_lanes(uint16_t *to, Floats values) {
    Ints bits;
    std::memcpy(&bits, &values, sizeof bits);
    const Ints normal = ((bits + 0xfff + (bits >> 13 & 1)) >> 13) - exponent_shift;
    const Ints subnormal = __builtin_convertvector(values * (1 / subnormal_unit) + 0.5f, Ints);
    store(to, __builtin_convertvector(values < least_normal ? subnormal : normal, HalfLanes));
}

#endif

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
