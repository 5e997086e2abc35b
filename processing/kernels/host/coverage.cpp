#include "host/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tomoshadow {

namespace {

struct Chord {
    float first, end;
};

// A disc in units of cells. Line n is the mean of the disc between n / coverage_lines and (n + 1) / coverage_lines.
struct Disc {
    double u, v, radius;
    int first_line, end_line;

    Disc(const double *centre, double radius_px, int lines)
        : u(coverage_cells * centre[0] + 0.5), v(coverage_cells * centre[1] + 0.5), radius(coverage_cells * radius_px) {
        const bool seen = std::isfinite(u) && radius > 0 && v + radius > 0 && v - radius < lines / coverage_lines;
        first_line = seen ? std::max(static_cast<int>(std::floor(coverage_lines * (v - radius))), 0) : 0;
        end_line = seen ? std::min(static_cast<int>(std::ceil(coverage_lines * (v + radius))), lines) : 0;
    }
    // Half the area above a row.
    double half_area(double row) const {
        const double beside = std::min(std::max((row - v) / radius, -1.0), 1.0);
        return 0.5 * radius * radius * (beside * std::sqrt(1 - beside * beside) + std::asin(beside));
    }
    // Calls work(line, chord) for all lines.
    template <class Work>
    void cut(Work work) const {
        double above = half_area(first_line / double(coverage_lines));
        for (int line = first_line; line < end_line; ++line) {
            const double next = half_area((line + 1) / double(coverage_lines)), half = coverage_lines * (next - above);
            work(line, Chord{static_cast<float>(u - half), static_cast<float>(u + half)});
            above = next;
        }
    }
};

void add_interval(float *cells, int columns, float first, float end) {
    constexpr float share = 1.0f / coverage_lines;
    const float from = std::max(first, 0.0f), to = std::min(end, static_cast<float>(columns));
    if (!(from < to)) return;
    const int left = static_cast<int>(from), right = std::min(static_cast<int>(to), columns - 1);
    if (left == right) {
        cells[left] += share * (to - from);
        return;
    }
    cells[left] += share * (static_cast<float>(left + 1) - from);
    for (int cell = left + 1; cell < right; ++cell) cells[cell] += share;
    cells[right] += share * (to - static_cast<float>(right));
}

// Chords of a line as if they were one set.
void add_united(Chord *chords, Chord *end, float *cells, int columns) {
    std::sort(chords, end, [](const Chord &one, const Chord &other) { return one.first < other.first; });
    while (chords != end) {
        Chord united = *chords++;
        for (; chords != end && chords->first <= united.end; ++chords) united.end = std::max(united.end, chords->end);
        add_interval(cells, columns, united.first, united.end);
    }
}

}  // namespace

void cover(const double *centres, const double *radii, int64_t count, float *cells, int rows, int columns) {
    const int lines = rows * coverage_cells * coverage_lines, cells_of_row = columns * coverage_cells;
    std::vector<Disc> discs;
    std::vector<int64_t> begin(static_cast<size_t>(lines) + 1);
    for (int64_t number = 0; number < count; ++number) {
        discs.emplace_back(centres + 2 * number, radii[number], lines);
        for (int line = discs.back().first_line; line < discs.back().end_line; ++line) ++begin[line + 1];
    }
    for (int line = 0; line < lines; ++line) begin[line + 1] += begin[line];
    std::vector<Chord> chords(static_cast<size_t>(begin[lines]));
    std::vector<int64_t> next(begin.begin(), begin.end() - 1);
    for (const Disc &disc : discs) disc.cut([&](int line, const Chord &chord) { chords[next[line]++] = chord; });
    std::fill(cells, cells + static_cast<int64_t>(rows) * coverage_cells * cells_of_row, 0.0f);
    for (int line = 0; line < lines; ++line)
        add_united(chords.data() + begin[line], chords.data() + begin[line + 1],
                   cells + static_cast<int64_t>(line / coverage_lines) * cells_of_row, cells_of_row);
}

}  // namespace tomoshadow
