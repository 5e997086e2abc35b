#include "host/blocks.hpp"

#include <cmath>
#include <cstdlib>
#include <utility>

#include "host/parallel.hpp"

namespace tomoshadow {

namespace {

// A power of two, so that blocks become a volume and blocks again unchanged. The largest voxel of the start is stored as
// 1 to 2: voxels.hpp has room for 16 more bits above it, and for 45 below.
float unit_for(float most) { return most > 0.0f ? std::ldexp(1.0f, std::ilogb(most)) : 1.0f; }

}  // namespace

void Blocks::Slab::Free::operator()(uint16_t *chunk) const { std::free(chunk); }

uint16_t *Blocks::Slab::next() {
    const size_t count = positions_.size();
    if (count == chunks_.size() * BlockList::per_chunk) {
        constexpr size_t bytes = sizeof(uint16_t) * BlockList::per_chunk * BlockList::size;
        std::unique_ptr<uint16_t[], Free> chunk(static_cast<uint16_t *>(std::aligned_alloc(64, bytes)));
        if (!chunk) out_of_memory();
        memory_.push_back(std::move(chunk));
        chunks_.push_back(memory_.back().get());
    }
    return list().voxels(static_cast<int>(count));
}

NewBlocks Blocks::Slab::growing() {
    return {this, [](void *slab) { return static_cast<Slab *>(slab)->next(); },
            [](void *slab, BlockPosition position) { static_cast<Slab *>(slab)->positions_.push_back(position); }};
}

std::vector<Blocks::Slab> Blocks::slabs_in(Blocks *memory, int count) {
    std::vector<Slab> slabs;
    if (memory) {
        slabs = std::exchange(memory->slabs_, {});
        memory->lent_ = true;
    }
    slabs.resize(count);
    for (Slab &slab : slabs) slab.forget();
    return slabs;
}

Blocks::Blocks(const Kernels &kernels, const BlockSearch &start, float most, int threads, Blocks *memory)
    : shape_(start.shape), unit_(unit_for(most)), slabs_(slabs_in(memory, (start.shape.ny + smart_rows - 1) / smart_rows)) {
    BlockSearch job = start;
    job.gain = 1.0f / unit_;
    for_each(static_cast<int>(slabs_.size()), threads, [&](int slab) { kernels.find_blocks(job, slab, slabs_[slab].growing()); });
}

Blocks Blocks::of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape,
                        float exponent, float floor, float most, int threads, Blocks *memory) {
    const BlockSearch start{views.data(), static_cast<int>(views.size()), nullptr, shape, exponent, floor, 0.0f};
    return {kernels, start, most, threads, memory};
}

Blocks Blocks::of_volume(const Kernels &kernels, const float *volume, const Shape &shape, float most, int threads,
                         Blocks *memory) {
    return {kernels, {nullptr, 0, volume, shape, 1.0f, 0.0f, 0.0f}, most, threads, memory};
}

void Blocks::write(const Kernels &kernels, Format format, void *volume, int first_row, int rows, float factor, int threads) const {
    const Shape part{shape_.nz, rows, shape_.nx};
    for_each((rows + smart_rows - 1) / smart_rows, threads, [&](int slab) {
        kernels.write_blocks(part, slab, this->slab(first_row / smart_rows + slab), unit() * factor, format, volume);
    });
}

int64_t Blocks::count() const {
    int64_t count = 0;
    for (const Slab &slab : slabs_) count += slab.count();
    return count;
}

}  // namespace tomoshadow
