// Parts of the Python module: each checks everything the kernels rely on, holds every buffer they read, and releases
// the GIL while they run.
#pragma once

#include <nanobind/nanobind.h>

namespace tomoshadow {

void bind_blobs(nanobind::module_ &module);
void bind_block_maxima(nanobind::module_ &module);
void bind_discs(nanobind::module_ &module);
void bind_images(nanobind::module_ &module);
void bind_line_of_sight(nanobind::module_ &module);
void bind_smart(nanobind::module_ &module);
void bind_stamping(nanobind::module_ &module);
void bind_zero_runs(nanobind::module_ &module);

}  // namespace tomoshadow
