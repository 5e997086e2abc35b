// A volume that is stored where it is not empty: what SMART works on.
#pragma once

#include <memory>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Blocks of a volume in which any voxel is not zero, slab by slab, in 16 bits (voxels.hpp). Once zero, a voxel stays zero
// under SMART, so blocks are found once.
class Blocks {
public:
    Blocks(Blocks &&) = default;
    // A power of the product of what all views see, where it exceeds `floor` somewhere in a block. `most` is what it
    // could be. Other blocks may lend their memory, and with it lose their volume.
    static Blocks of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape, float exponent,
                           float floor, float most, int threads, Blocks *memory = nullptr);
    // A volume (z, y, x) of float32, not negative, nowhere above `most`.
    static Blocks of_volume(const Kernels &kernels, const float *volume, const Shape &shape, float most, int threads,
                            Blocks *memory = nullptr);

    BlockList slab(int number) const { return slabs_[number].list(); }
    // Intensity of a stored 1, in which projections come.
    float unit() const { return unit_ * gain_; }
    // A factor waits for the next update of the voxels, which applies it.
    void scale(float factor) { gain_ *= factor; }
    float gain() const { return gain_; }
    void gain_applied() { gain_ = 1.0f; }
    // Rows [first_row, first_row + rows) of the volume, times a factor; first_row is a multiple of smart_rows.
    void write(const Kernels &kernels, Format format, void *volume, int first_row, int rows, float factor, int threads) const;
    // Whether other blocks took the memory: there is no volume any more.
    bool lent() const { return lent_; }

    const Shape &shape() const { return shape_; }
    int64_t count() const;
    int64_t bytes() const { return count() * static_cast<int64_t>(sizeof(uint16_t) * BlockList::size + sizeof(BlockPosition)); }

private:
    // The blocks of a slab. Their memory comes in chunks, so that nothing is copied when it grows; it is kept for later
    // when blocks are forgotten.
    class Slab {
    public:
        BlockList list() const { return {positions_.data(), static_cast<int>(positions_.size()), chunks_.data()}; }
        int count() const { return static_cast<int>(positions_.size()); }
        void forget() { positions_.clear(); }
        NewBlocks growing();

    private:
        struct Free {
            void operator()(uint16_t *chunk) const;
        };
        uint16_t *next();
        std::vector<BlockPosition> positions_;
        std::vector<std::unique_ptr<uint16_t[], Free>> memory_;
        std::vector<uint16_t *> chunks_;
    };
    Blocks(const Kernels &kernels, const BlockSearch &job, float most, int threads, Blocks *memory);
    static std::vector<Slab> slabs_in(Blocks *memory, int count);

    Shape shape_;
    float unit_, gain_ = 1.0f;
    bool lent_ = false;
    std::vector<Slab> slabs_;
};

}  // namespace tomoshadow
