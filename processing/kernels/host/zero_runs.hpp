// Deflate for numbers that nothing but their zeros makes shorter.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tomoshadow {

// Bytes that no packed stream of so many words exceeds.
size_t most_packed_bytes(size_t count);

// A zlib stream (RFC 1950 and 1951) of words: runs of zeros become matches, all else is stored as it is. `adler` is the
// Adler-32 of the words; returns the bytes written.
size_t pack_zero_runs(const uint32_t *words, size_t count, uint32_t adler, uint8_t *out);

}  // namespace tomoshadow
