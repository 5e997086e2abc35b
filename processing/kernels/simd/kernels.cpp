// The list of all kernels. This file is compiled once per instruction set; all it defines lives in the
// namespace of that set and calls no inline function of the standard library, so that the linker cannot hand
// code for a newer processor to an older one.
#include "job.hpp"
#include "simd/blobs.hpp"
#include "simd/blocks.hpp"
#include "simd/discs.hpp"
#include "simd/line_of_sight.hpp"
#include "simd/preprocess.hpp"
#include "simd/ratios.hpp"
#include "simd/resample.hpp"
#include "simd/smart.hpp"

#define TOMOSHADOW_TEXT_(name) #name
#define TOMOSHADOW_TEXT(name) TOMOSHADOW_TEXT_(name)

namespace tomoshadow::TOMOSHADOW_ISA {

extern const Kernels kernels;
const Kernels kernels{
    TOMOSHADOW_TEXT(TOMOSHADOW_ISA), line_of_sight, sum_of_sight, find_blocks, write_blocks, smart_pass, correct,
    resample, brightest, quantise, find_filled, row_minima, column_minima, row_means, subtract_veil,
    draw_blobs, sweep_blobs, weigh_blobs,
    draw_discs, sweep_discs, weigh_discs};

}  // namespace tomoshadow::TOMOSHADOW_ISA
