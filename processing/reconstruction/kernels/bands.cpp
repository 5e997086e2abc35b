#include "bands.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <thread>

namespace tomoshadow {

namespace {

constexpr int max_bands = 16;

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

// Storage of the image rows that one band projects onto.
class BandImage {
public:
    BandImage() = default;
    BandImage(const View &view, const Shape &shape, const Band &band) {
        const int y1 = std::min(band.end_slab * smart_rows, shape.ny) - 1;
        const Range seen = rows_seen(view, shape, band.first_slab * smart_rows, y1);
        const int last = view.rows - 1;
        const auto clamped = [last](double row) { return static_cast<int>(std::clamp(row, 0.0, double(last))); };
        const int first = clamped(std::floor(seen.low) - 1), end = clamped(std::ceil(seen.high) + 2) + 1;
        pixels_.assign(static_cast<size_t>(end - first) * view.columns, 0.0f);
        projection_ = {pixels_.data(), first, end - first, view.columns};
    }
    const Projection &projection() const { return projection_; }

private:
    std::vector<float> pixels_;
    Projection projection_{};
};

void add(const Projection &part, float *image) {
    float *to = image + static_cast<size_t>(part.first_row) * part.columns;
    const size_t count = static_cast<size_t>(part.rows) * part.columns;
    for (size_t i = 0; i < count; ++i) to[i] += part.pixels[i];
}

}  // namespace

void for_each(int count, int threads, const std::function<void(int)> &work) {
    const auto share = [&](int thread) {
        for (int i = thread; i < count; i += threads) work(i);
    };
    std::vector<std::thread> others;
    for (int thread = 1; thread < std::min(threads, count); ++thread) others.emplace_back(share, thread);
    share(0);
    for (std::thread &other : others) other.join();
}

void run_line_of_sight(const Kernels &kernels, const LineOfSight &job, int threads) {
    const int slabs = (job.shape.ny + sight_rows - 1) / sight_rows;
    for_each(slabs, threads, [&](int slab) { kernels.line_of_sight(job, slab); });
}

void run_sum_of_sight(const Kernels &kernels, const SumOfSight &job, int threads) {
    const int slabs = (job.shape.ny + sight_rows - 1) / sight_rows;
    for_each(slabs, threads, [&](int slab) { kernels.sum_of_sight(job, slab); });
}

void run_bands(const SmartPass &job, const std::vector<float *> &sums, int threads,
               const std::function<void(int slab, const Projection *projections)> &work) {
    const auto bands = bands_of((job.shape.ny + smart_rows - 1) / smart_rows);
    std::vector<std::vector<BandImage>> images(bands.size());
    for_each(static_cast<int>(bands.size()), threads, [&](int b) {
        std::vector<Projection> projections;
        for (int i = 0; i < job.n_views; ++i) {
            images[b].push_back(sums[i] ? BandImage(job.views[i], job.shape, bands[b]) : BandImage());
            projections.push_back(images[b].back().projection());
        }
        for (int slab = bands[b].first_slab; slab < bands[b].end_slab; ++slab) work(slab, projections.data());
    });
    for_each(job.n_views, threads, [&](int i) {
        if (!sums[i]) return;
        std::memset(sums[i], 0, sizeof(float) * job.views[i].rows * job.views[i].columns);
        for (const auto &band : images) add(band[i].projection(), sums[i]);
    });
}

}  // namespace tomoshadow
