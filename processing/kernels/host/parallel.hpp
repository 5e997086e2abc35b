// Work shared by threads, none of which touches what another one writes: the same input gives the same bits.
#pragma once

#include <functional>

namespace tomoshadow {

// Call work(i) for i = 0 .. count - 1; whichever thread is free takes the next one. Throws what the first call throws that
// fails; the others are finished, and those that have not begun are left out.
void for_each(int count, int threads, const std::function<void(int)> &work);

// The same for the rows of an image, a few at once: work(first row, end row).
void for_rows(int rows, int threads, const std::function<void(int, int)> &work);

}  // namespace tomoshadow
