// From blocks to the volume: roots, number formats, and stores that do not pass through the caches.
#pragma once

#include "simd/workspace.hpp"

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

inline void store_bytes(uint8_t *to, const float *from, int count) {
    for (int k = 0; k < count; ++k) {
        const float scaled = from[k] * 255.0f + 0.5f;
        to[k] = static_cast<uint8_t>(scaled < 255.0f ? scaled : 255.0f);
    }
}

template <Format format>
[[gnu::always_inline]] inline void store_values(uint8_t *to, const float *from, int count) {
    if constexpr (format == Format::single)
        std::memcpy(to, from, sizeof(float) * static_cast<size_t>(count));
    else if constexpr (format == Format::half)
        store_halves(reinterpret_cast<uint16_t *>(to), from, count);
    else
        store_bytes(to, from, count);
}

// The first columns of a block, to rows `stride` bytes apart.
template <Format format>
inline void store_block(uint8_t *to, int64_t stride, const Block &block, int rows, int columns) {
    for (int row = 0; row < rows; ++row, to += stride)
        if (columns == block_columns)
            store_values<format>(to, block.rows[row], block_columns);
        else
            store_values<format>(to, block.rows[row], columns);
}

inline void store_block(Format format, uint8_t *to, int64_t stride, const Block &block, int rows, int columns) {
    if (format == Format::single) return store_block<Format::single>(to, stride, block, rows, columns);
    if (format == Format::half) return store_block<Format::half>(to, stride, block, rows, columns);
    store_block<Format::byte>(to, stride, block, rows, columns);
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
#if defined(__AVX512F__)
            _mm512_stream_si512(reinterpret_cast<__m512i *>(target + at), _mm512_loadu_si512(source + at));
#else
            const auto *line = reinterpret_cast<const __m256i *>(source + at);
            auto *out = reinterpret_cast<__m256i *>(target + at);
            _mm256_stream_si256(out, _mm256_loadu_si256(line));
            _mm256_stream_si256(out + 1, _mm256_loadu_si256(line + 1));
#endif
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

// The rows of a slab in a few planes, which lie side by side in the volume; whole blocks may overhang the last one.
class Staging {
public:
    Staging(Format format, int nx, int rows, int planes = 1, int first_column = 0)
        : format_(format),
          nx_(nx),
          first_column_(first_column),
          blocks_(nx / block_columns + 1),
          bytes_(bytes_of(format) * static_cast<int64_t>(nx) * rows),
          memory_(bytes_ * planes),
          empty_(static_cast<int64_t>(blocks_) * planes) {
        std::memset(empty_.as<bool>(), true, static_cast<size_t>(blocks_) * static_cast<size_t>(planes));
    }

    void put(const Tile &tile, const Block &block, int plane = 0) {
        empty(tile, plane) = false;
        store_block(format_, at(tile, plane), row_bytes(), block, tile.rows, columns_of(tile));
    }
    void put_zeros(const Tile &tile, int plane = 0) {
        if (empty(tile, plane)) return;
        empty(tile, plane) = true;
        for (int row = 0; row < tile.rows; ++row)
            std::memset(at(tile, plane) + row_bytes() * row, 0, static_cast<size_t>(bytes_of(format_) * columns_of(tile)));
    }
    void write(const Shape &shape, int z, int y0, void *volume, int plane = 0) const {
        stream(target(shape, z, y0, volume), start(plane), bytes_);
    }

    uint8_t *start(int plane) const { return memory_.as<uint8_t>() + bytes_ * plane; }
    uint8_t *target(const Shape &shape, int z, int y0, void *volume) const {
        return static_cast<uint8_t *>(volume) + bytes_of(format_) * (static_cast<int64_t>(z) * shape.ny + y0) * nx_;
    }
    int64_t bytes() const { return bytes_; }

private:
    int columns_of(const Tile &tile) const { return smaller(block_columns, nx_ - column_of(tile)); }
    int column_of(const Tile &tile) const { return tile.x0 - first_column_; }
    int64_t row_bytes() const { return static_cast<int64_t>(bytes_of(format_)) * nx_; }
    uint8_t *at(const Tile &tile, int plane) const { return start(plane) + bytes_of(format_) * column_of(tile); }
    bool &empty(const Tile &tile, int plane) const {
        return empty_.as<bool>()[plane * blocks_ + column_of(tile) / block_columns];
    }

    Format format_;
    int nx_, first_column_, blocks_;
    int64_t bytes_;  // of a plane
    Memory memory_, empty_;  // empty_: whether a block of columns is zero already
};

// Writes finished planes piece by piece while others are computed, so that nobody waits for the memory.
class Drain {
public:
    Drain() = default;
    Drain(const Staging &staging, const Shape &shape, int z0, int z_end, int y0, void *volume)
        : staging_(&staging), shape_(shape), z_(z0), z0_(z0), z_end_(z_end), y0_(y0), volume_(volume) {}
    void write(int64_t bytes) {
        while (bytes > 0 && z_ < z_end_) {
            uint8_t *to = staging_->target(shape_, z_, y0_, volume_) + done_;
            int64_t count = bytes + (-reinterpret_cast<int64_t>(to + bytes) & 63);  // up to the next cache line
            const int64_t left = staging_->bytes() - done_;
            if (count > left) count = left;
            stream(to, staging_->start(z_ - z0_) + done_, count);
            bytes -= count;
            done_ += count;
            if (done_ == staging_->bytes()) ++z_, done_ = 0;
        }
    }
    void finish() { write(staging_ ? staging_->bytes() * (z_end_ - z_) : 0); }

private:
    const Staging *staging_ = nullptr;
    Shape shape_{};
    int z_ = 0, z0_ = 0, z_end_ = 0, y0_ = 0;
    void *volume_ = nullptr;
    int64_t done_ = 0;  // bytes of plane z_
};

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
