#include "host/smart.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <thread>

namespace tomoshadow {

namespace {

constexpr int rows_at_once = 16;

struct Band {
    int first_slab, end_slab;
};

std::vector<Band> bands_of(int slabs) {
    const int count = std::min(slabs, max_bands);
    std::vector<Band> bands;
    for (int i = 0; i < count; ++i) bands.push_back({slabs * i / count, slabs * (i + 1) / count});
    return bands;
}

struct Range {
    double low = INFINITY, high = -INFINITY;
    void include(double value) {
        low = std::min(low, value);
        high = std::max(high, value);
    }
};

// Image rows that voxel rows y0 .. y1 are seen at.
Range rows_seen(const View &view, const Shape &shape, int y0, int y1) {
    Range rows;
    if (!view.nodes) {
        for (int z = 0; z < shape.nz; ++z)
            for (int y : {y0 - 1, y1 + 1}) rows.include(view.scale[z] * y + view.shift_v[z]);
        return rows;
    }
    const float *v = view.nodes + static_cast<size_t>(view.nodes_z) * view.nodes_y * view.nodes_x;
    for (int z = 0; z < view.nodes_z; ++z)
        for (int y = y0 / view.spacing; y <= y1 / view.spacing + 1; ++y)
            for (int x = 0; x < view.nodes_x; ++x)
                rows.include(v[(static_cast<size_t>(z) * view.nodes_y + y) * view.nodes_x + x]);
    return rows;
}

}  // namespace

void for_each(int count, int threads, const std::function<void(int)> &work) {
    std::atomic<int> next{0};
    const auto share = [&] {
        for (int i = next++; i < count; i = next++) work(i);
    };
    std::vector<std::thread> others;
    for (int thread = 1; thread < std::min(threads, count); ++thread) others.emplace_back(share);
    share();
    for (std::thread &other : others) other.join();
}

void for_rows(int rows, int threads, const std::function<void(int, int)> &work) {
    for_each((rows + rows_at_once - 1) / rows_at_once, threads, [&](int chunk) {
        work(chunk * rows_at_once, std::min(rows, (chunk + 1) * rows_at_once));
    });
}

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads) {
    const int slabs = (job.shape.ny + sight_rows - 1) / sight_rows;
    for_each(slabs, threads, [&](int slab) { kernels.line_of_sight(job, slab); });
}

void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads) {
    const int slabs = (job.shape.ny + sight_rows - 1) / sight_rows;
    for_each(slabs, threads, [&](int slab) { kernels.sum_of_sight(job, slab); });
}

BandImages::BandImages(const std::vector<View> &views, const Shape &shape) {
    constexpr int pixels_per_line = sizeof(Line) / sizeof(float);
    for (const Band &band : bands_of((shape.ny + smart_rows - 1) / smart_rows)) {
        Images images{band.first_slab, band.end_slab, {}, {}};
        for (const View &view : views) {
            const int y1 = std::min(band.end_slab * smart_rows, shape.ny) - 1;
            const Range seen = rows_seen(view, shape, band.first_slab * smart_rows, y1);
            const int last = view.rows - 1;
            const auto clamped = [last](double row) { return static_cast<int>(std::clamp(row, 0.0, double(last))); };
            const int first = clamped(std::floor(seen.low) - 1), end = clamped(std::ceil(seen.high) + 2) + 1;
            const size_t lines = (view.columns + pixels_per_line - 1) / pixels_per_line;
            images.memory.emplace_back(static_cast<size_t>(end - first + 1) * lines);
            images.parts.push_back({images.memory.back().data()->pixels, first, end - first,
                                    static_cast<int64_t>(lines * pixels_per_line)});
        }
        bands_.push_back(std::move(images));
    }
}

void BandImages::project(const std::vector<bool> &wanted, int threads,
                         const std::function<void(int slab, const Projection *projections)> &work) {
    for_each(static_cast<int>(bands_.size()), threads, [&](int b) {
        Images &images = bands_[b];
        std::vector<Projection> projections = images.parts;
        for (size_t i = 0; i < wanted.size(); ++i) {
            if (wanted[i])
                std::fill(images.memory[i].begin(), images.memory[i].end(), Line{});
            else
                projections[i].pixels = nullptr;
        }
        for (int slab = images.first_slab; slab < images.end_slab; ++slab) work(slab, projections.data());
    });
}

double BandImages::sum(int view) const {
    double sum = 0;
    for (const Projection &part : parts(view))
        for (int64_t i = 0; i < part.rows * part.stride; ++i) sum += part.pixels[i];
    return sum;
}

double BandImages::correct(const Kernels &kernels, int view, Correction job, int threads) const {
    const auto found = parts(view);
    job.parts = found.data();
    job.n_parts = static_cast<int>(found.size());
    std::vector<double> missed(job.rows);
    for_each(job.rows, threads, [&](int row) { missed[row] = kernels.correct(job, row); });
    double sum = 0;
    for (double row : missed) sum += row;
    return sum;
}

std::vector<Projection> BandImages::parts(int view) const {
    std::vector<Projection> parts;
    for (const Images &images : bands_) parts.push_back(images.parts[view]);
    return parts;
}

}  // namespace tomoshadow
