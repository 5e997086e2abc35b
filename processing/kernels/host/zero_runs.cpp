#include "host/zero_runs.hpp"

#include <cstring>

namespace tomoshadow {

namespace {

constexpr size_t least_run = 8;                    // words; a shorter run costs less where it is stored
constexpr size_t most_stored = 65535 / 4;          // words of a stored block
constexpr size_t block_bytes = 5, run_bytes = 10;  // at most: head of a stored block; a run but for its longest matches

// Bits of a deflate stream, the lowest first.
class Bits {
public:
    explicit Bits(uint8_t *out) : out_(out) {}
    void put(uint32_t bits, int count) {
        held_ |= static_cast<uint64_t>(bits) << count_;
        for (count_ += count; count_ >= 8; count_ -= 8, held_ >>= 8) *out_++ = static_cast<uint8_t>(held_);
    }
    // A Huffman code: its highest bit comes first.
    void put_code(uint32_t code, int count) {
        while (count--) put(code >> count & 1, 1);
    }
    uint8_t *to_byte() {
        if (count_) put(0, 8 - count_);
        return out_;
    }
    void go_on(uint8_t *out) { out_ = out; }

private:
    uint8_t *out_;
    uint64_t held_ = 0;
    int count_ = 0;
};

// "The same byte again", 3 to 258 times: a length of the fixed codes (RFC 1951, 3.2.5 and 3.2.6), distance 1.
void put_match(Bits &bits, uint32_t length) {
    const uint32_t beyond = length - 3;
    int extra = 0;
    while (beyond >> extra >= 8) ++extra;
    const uint32_t symbol = length == 258 ? 285 : 257 + 4 * static_cast<uint32_t>(extra) + (beyond >> extra);
    if (length == 258) extra = 0;
    if (symbol < 280)
        bits.put_code(symbol - 256, 7);
    else
        bits.put_code(0xc0 + symbol - 280, 8);
    bits.put(beyond & ((1u << extra) - 1), extra);
    bits.put_code(0, 5);
}

// A block of fixed codes: zeros, a literal and its repetitions.
void put_zeros(Bits &bits, size_t bytes) {
    constexpr uint32_t longest = 258, shortest = 3, longest_match = 0xa3;  // as its bits come, distance 1 included
    bits.put(2, 3);
    bits.put_code(0x30, 8);
    size_t left = bytes - 1;
    for (; left >= longest + shortest; left -= longest) bits.put(longest_match, 13);
    if (left > longest) {
        put_match(bits, shortest);
        left -= shortest;
    }
    put_match(bits, static_cast<uint32_t>(left));
    bits.put(0, 7);
}

void put_stored(Bits &bits, const uint32_t *words, size_t count) {
    while (count) {
        const size_t some = count < most_stored ? count : most_stored;
        const auto length = static_cast<uint16_t>(4 * some);
        bits.put(0, 3);
        uint8_t *out = bits.to_byte();
        const uint8_t head[] = {static_cast<uint8_t>(length), static_cast<uint8_t>(length >> 8),
                                static_cast<uint8_t>(~length), static_cast<uint8_t>(~length >> 8)};
        std::memcpy(out, head, sizeof head);
        std::memcpy(out + sizeof head, words, length);
        bits.go_on(out + sizeof head + length);
        words += some;
        count -= some;
    }
}

struct Run {
    size_t first, end;
};
// The next run that is worth a match; [count, count) where there is none. It has one of every `least_run` words.
Run next_run(const uint32_t *words, size_t from, size_t count) {
    for (size_t inside = from + least_run - 1; inside < count; inside += least_run) {
        if (words[inside]) continue;
        Run run{inside, inside + 1};
        while (run.first > from && !words[run.first - 1]) --run.first;
        while (run.end < count && !words[run.end]) ++run.end;
        if (run.end - run.first >= least_run) return run;
    }
    return {count, count};
}

}  // namespace

size_t most_packed_bytes(size_t count) {
    static_assert(run_bytes + block_bytes <= 4 * least_run, "a run is shorter packed");
    return 4 * count + block_bytes * (count / most_stored + 2) + 16;
}

size_t pack_zero_runs(const uint32_t *words, size_t count, uint32_t adler, uint8_t *out) {
    Bits bits(out);
    bits.put(0x0178, 16);
    for (size_t at = 0; at < count;) {
        const Run run = next_run(words, at, count);
        put_stored(bits, words + at, run.first - at);
        if (run.end > run.first) put_zeros(bits, 4 * (run.end - run.first));
        at = run.end;
    }
    bits.put(3, 10);  // the last block: empty
    uint8_t *end = bits.to_byte();
    for (int shift = 24; shift >= 0; shift -= 8) *end++ = static_cast<uint8_t>(adler >> shift);
    return static_cast<size_t>(end - out);
}

}  // namespace tomoshadow
