#include "blocks.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

namespace tomoshadow {

namespace {

// A power of two, so that blocks become a volume and blocks again unchanged. The largest voxel of the start is stored as
// 1 to 2: voxels.hpp has room for 16 more bits above it, and for 45 below.
float unit_for(float most) { return most > 0.0f ? std::ldexp(1.0f, std::ilogb(most)) : 1.0f; }

}  // namespace

Blocks::Blocks(const Kernels &kernels, const SmartStart &start, float most, int threads)
    : shape_(start.shape), unit_(unit_for(most)), slabs_((start.shape.ny + smart_rows - 1) / smart_rows) {
    SmartStart job = start;
    job.gain = 1.0f / unit_;
    const auto keep = [](void *owner, BlockPosition position, const uint16_t *values) {
        Slab &slab = *static_cast<Slab *>(owner);
        slab.positions.push_back(position);
        slab.values.emplace_back();
        std::memcpy(&slab.values.back(), values, sizeof(Values));
    };
    // Grown in memory that is warm, then copied: fresh memory costs more than the copy, and a slab keeps none to spare.
    std::vector<Slab> found(threads);
    for_each(static_cast<int>(slabs_.size()), threads, [&](int number) {
        Slab &slab = found[number % threads];  // for_each deals the same to the same thread
        slab.positions.clear();
        slab.values.clear();
        kernels.smart_start(job, number, keep, &slab);
        slabs_[number] = slab;
    });
}

Blocks Blocks::of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape,
                        float exponent, float floor, float most, int threads) {
    const SmartStart start{views.data(), static_cast<int>(views.size()), nullptr, shape, exponent, floor, 0.0f};
    return {kernels, start, most, threads};
}

Blocks Blocks::of_volume(const Kernels &kernels, const float *volume, const Shape &shape, float most, int threads) {
    return {kernels, {nullptr, 0, volume, shape, 1.0f, 0.0f, 0.0f}, most, threads};
}

void Blocks::pass(const Kernels &kernels, const std::vector<View> &views, const std::vector<bool> &update,
                  const std::vector<bool> &project, BandImages &images, int threads) {
    const auto updated = std::make_unique<bool[]>(update.size());
    std::copy(update.begin(), update.end(), updated.get());
    const SmartPass job{views.data(), updated.get(), gain_, static_cast<int>(views.size()), shape_};
    images.project(project, threads, [&](int slab, const Projection *projections) {
        kernels.smart_pass(job, slab, slabs_[slab].list(), projections);
    });
    if (std::find(update.begin(), update.end(), true) != update.end()) gain_ = 1.0f;
}

void Blocks::write(const Kernels &kernels, Format format, void *volume, int threads) {
    for_each(static_cast<int>(slabs_.size()), threads, [&](int slab) {
        kernels.write_blocks(shape_, slab, slabs_[slab].list(), unit(), format, volume);
    });
}

int64_t Blocks::count() const {
    int64_t count = 0;
    for (const Slab &slab : slabs_) count += static_cast<int64_t>(slab.positions.size());
    return count;
}

}  // namespace tomoshadow
