#include "host/smart.hpp"

#include <algorithm>
#include <cmath>

#include "host/parallel.hpp"

namespace tomoshadow {

namespace {

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

double path_length(const Path &path, int row, int column) {
    const double along = (column - path.foot_u) * path.per_distance, across = (row - path.foot_v) * path.per_distance;
    return std::sqrt(1 + along * along + across * across);
}

double sum_of(const View &view, const Projection &part) {
    double sum = 0;
    for (int row = 0; row < part.rows; ++row) {
        const float *pixels = part.pixels + row * part.stride;
        for (int column = 0; column < view.columns; ++column)
            if (pixels[column] != 0.0f) sum += pixels[column] * path_length(view.path, part.first_row + row, column);
    }
    return sum;
}

}  // namespace

Projections::Band::Band(const std::vector<View> &views, const Shape &shape, int first_slab, int end_slab)
    : first_slab(first_slab), end_slab(end_slab) {
    constexpr int pixels_per_line = sizeof(Line) / sizeof(float);
    for (const View &view : views) {
        const int y1 = std::min(end_slab * smart_rows, shape.ny) - 1;
        const Range seen = rows_seen(view, shape, first_slab * smart_rows, y1);
        const int last = view.rows - 1;
        const auto clamped = [last](double row) { return static_cast<int>(std::clamp(row, 0.0, double(last))); };
        const int first = clamped(std::floor(seen.low) - 1), end = clamped(std::ceil(seen.high) + 2) + 1;
        const size_t lines = (view.columns + pixels_per_line - 1) / pixels_per_line;
        memory_.emplace_back(static_cast<size_t>(end - first + 1) * lines);
        parts_.push_back({memory_.back().data()->pixels, first, end - first, static_cast<int64_t>(lines * pixels_per_line)});
    }
}

std::vector<Projection> Projections::Band::cleared(const std::vector<bool> &wanted) {
    std::vector<Projection> parts = parts_;
    for (size_t i = 0; i < wanted.size(); ++i) {
        if (wanted[i])
            std::fill(memory_[i].begin(), memory_[i].end(), Line{});
        else
            parts[i].pixels = nullptr;
    }
    return parts;
}

Projections::Projections(std::vector<View> views, const Shape &shape) : views_(std::move(views)), shape_(shape) {
    const int slabs = (shape.ny + smart_rows - 1) / smart_rows, count = std::min(slabs, max_bands);
    for (int i = 0; i < count; ++i) bands_.emplace_back(views_, shape_, slabs * i / count, slabs * (i + 1) / count);
}

void Projections::pass(const Kernels &kernels, Blocks &blocks, const std::vector<bool> &update,
                       const std::vector<bool> &project, int threads) {
    const auto first = std::find(update.begin(), update.end(), true), end = std::find(first, update.end(), false);
    const SmartPass job{views_.data(), static_cast<int>(views_.size()), static_cast<int>(first - update.begin()),
                        static_cast<int>(end - first), blocks.gain(), shape_};
    for_each(static_cast<int>(bands_.size()), threads, [&](int number) {
        Band &band = bands_[number];
        const std::vector<Projection> projections = band.cleared(project);
        for (int slab = band.first_slab; slab < band.end_slab; ++slab)
            kernels.smart_pass(job, slab, blocks.slab(slab), projections.data());
    });
    if (job.n_updates) blocks.gain_applied();
}

double Projections::sum(int view) const {
    double sum = 0;
    for (const Projection &part : parts(view)) sum += sum_of(views_[view], part);
    return sum;
}

double Projections::correct(const Kernels &kernels, int view, Correction job, int threads) const {
    const auto found = parts(view);
    job.path = views_[view].path;
    job.parts = found.data();
    job.n_parts = static_cast<int>(found.size());
    std::vector<double> missed(job.rows);
    for_each(job.rows, threads, [&](int row) { missed[row] = kernels.correct(job, row); });
    double sum = 0;
    for (double row : missed) sum += row;
    return sum;
}

std::vector<Projection> Projections::parts(int view) const {
    std::vector<Projection> parts;
    for (const Band &band : bands_) parts.push_back(band.part(view));
    return parts;
}

}  // namespace tomoshadow
