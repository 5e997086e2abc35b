// A volume that is stored where it is not empty: what SMART works on.
#pragma once

#include <vector>

#include "job.hpp"

namespace tomoshadow {

// Blocks of a volume in which any voxel is not zero, slab by slab. Once zero, a voxel stays zero under SMART, so
// blocks are found once.
class Blocks {
public:
    // The product of what all views see, where it exceeds `floor` somewhere in a block.
    static Blocks of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape, float floor,
                           int threads);
    // A volume (z, y, x) of float32.
    static Blocks of_volume(const float *volume, const Shape &shape, int threads);

    // Multiply by the samples of the ratio images of the views to update, then project: sums[i] is the image of view
    // i, or null. Bands of slabs project into images of their own, which are added in order: results do not depend on
    // `threads`.
    void pass(const Kernels &kernels, const std::vector<View> &views, const bool *update,
              const std::vector<float *> &sums, int threads);
    void scale(float factor, int threads);
    void write(const Kernels &kernels, Format format, void *volume, int threads);

    const Shape &shape() const { return shape_; }
    int64_t count() const;

private:
    struct alignas(64) Values {
        float rows[smart_rows][block_columns];
    };
    struct Slab {
        std::vector<BlockPosition> positions;
        std::vector<Values> values;
        void keep(BlockPosition position, const float *from);
        BlockList list() { return {positions.data(), static_cast<int>(positions.size()), values.data()->rows[0]}; }
    };
    explicit Blocks(const Shape &shape);

    Shape shape_;
    std::vector<Slab> slabs_;
};

}  // namespace tomoshadow
