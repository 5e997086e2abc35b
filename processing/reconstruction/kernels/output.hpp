// From blocks to the volume: roots, number formats, and stores that do not pass through the caches.
#pragma once

#include "workspace.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

// Powers of two by square roots; others from a guess by exponent, which four steps of Newton's method make exact.
inline Floats root(Floats x, int n) {
    const Floats zero{};
    x = x > zero ? x : zero;
    if ((n & (n - 1)) == 0) {
        for (; n > 1; n /= 2) x = square_root(x);
        return x;
    }
    constexpr int32_t one = 0x3f800000;
    const float share = 1.0f / static_cast<float>(n);
    Ints bits;
    std::memcpy(&bits, &x, sizeof bits);
    bits = __builtin_convertvector(__builtin_convertvector(bits - one, Floats) * share, Ints) + one;
    Floats guess;
    std::memcpy(&guess, &bits, sizeof guess);
    for (int step = 0; step < 4; ++step) {
        Floats power = guess;
        for (int k = 2; k < n; ++k) power *= guess;
        guess += (x / power - guess) * share;
    }
    return x > zero ? guess : zero;
}

inline void take_root(Block &block, int rows, int n) {
    for (int row = 0; row < rows; ++row)
        for (int k = 0; k < block_columns; k += lanes)
            store(block.rows[row] + k, root(load<Floats>(block.rows[row] + k), n));
}

inline void store_bytes(uint8_t *to, const float *from, int count) {
    for (int k = 0; k < count; ++k) {
        const float scaled = from[k] * 255.0f + 0.5f;
        to[k] = static_cast<uint8_t>(scaled < 255.0f ? scaled : 255.0f);
    }
}

inline void store_values(Format format, void *to, int64_t at, const float *from, int count) {
    if (format == Format::single)
        std::memcpy(static_cast<float *>(to) + at, from, sizeof(float) * static_cast<size_t>(count));
    else if (format == Format::half)
        store_halves(static_cast<uint16_t *>(to) + at, from, count);
    else
        store_bytes(static_cast<uint8_t *>(to) + at, from, count);
}

// Copy to memory that is not read again soon.
inline void stream(void *to, const void *from, int64_t bytes) {
    auto *target = static_cast<uint8_t *>(to);
    const auto *source = static_cast<const uint8_t *>(from);
#if defined(__AVX2__)
    const int64_t head = -reinterpret_cast<int64_t>(target) & 63;
    if (bytes > 128) {
        std::memcpy(target, source, static_cast<size_t>(head));
        int64_t at = head;
        for (; at + 64 <= bytes; at += 64) {
            const auto *line = reinterpret_cast<const __m256i *>(source + at);
            auto *out = reinterpret_cast<__m256i *>(target + at);
            _mm256_stream_si256(out, _mm256_loadu_si256(line));
            _mm256_stream_si256(out + 1, _mm256_loadu_si256(line + 1));
        }
        target += at;
        source += at;
        bytes -= at;
    }
#endif
    std::memcpy(target, source, static_cast<size_t>(bytes));
}

inline void finish_streams() {
#if defined(__AVX2__)
    _mm_sfence();
#endif
}

// The rows of a slab in one plane, which lie side by side in the volume; whole blocks may overhang the last one.
class Staging {
public:
    Staging(Format format, int nx, int rows)
        : format_(format),
          nx_(nx),
          memory_(bytes_of(format) * static_cast<int64_t>(nx) * rows),
          empty_(nx / block_columns + 1) {
        std::memset(empty_.as<bool>(), true, static_cast<size_t>(nx / block_columns + 1));
    }

    void put(const Tile &tile, const Block &block) {
        empty_.as<bool>()[tile.x0 / block_columns] = false;
        const int columns = smaller(block_columns, nx_ - tile.x0);
        for (int row = 0; row < tile.rows; ++row) {
            const int64_t at = static_cast<int64_t>(row) * nx_ + tile.x0;
            if (columns == block_columns)
                store_values(format_, memory_.as<void>(), at, block.rows[row], block_columns);
            else
                store_values(format_, memory_.as<void>(), at, block.rows[row], columns);
        }
    }
    void put_zeros(const Tile &tile) {
        bool &empty = empty_.as<bool>()[tile.x0 / block_columns];
        if (empty) return;
        empty = true;
        const int64_t size = bytes_of(format_), columns = smaller(block_columns, nx_ - tile.x0);
        for (int row = 0; row < tile.rows; ++row)
            std::memset(memory_.as<uint8_t>() + size * (static_cast<int64_t>(row) * nx_ + tile.x0), 0,
                        static_cast<size_t>(size * columns));
    }
    void write(const Shape &shape, int z, int y0, int rows, void *volume) const {
        const int64_t size = bytes_of(format_), at = (static_cast<int64_t>(z) * shape.ny + y0) * nx_;
        stream(static_cast<uint8_t *>(volume) + size * at, memory_.as<void>(), size * rows * nx_);
    }

private:
    Format format_;
    int nx_;
    Memory memory_, empty_;  // empty_: whether a block of columns is zero already
};

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
