// A volume that is stored where it is not empty: what SMART works on.
#pragma once

#include <vector>

#include "bands.hpp"
#include "job.hpp"

namespace tomoshadow {

// Blocks of a volume in which any voxel is not zero, slab by slab, in 16 bits (voxels.hpp). Once zero, a voxel stays zero
// under SMART, so blocks are found once.
class Blocks {
public:
    // A power of the product of what all views see, where it exceeds `floor` somewhere in a block. `most` is what it
    // could be.
    static Blocks of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape, float exponent,
                           float floor, float most, int threads);
    // A volume (z, y, x) of float32, not negative, nowhere above `most`.
    static Blocks of_volume(const Kernels &kernels, const float *volume, const Shape &shape, float most, int threads);

    // Multiply by the samples of the ratio images of the views to update, then project onto the views to project.
    void pass(const Kernels &kernels, const std::vector<View> &views, const std::vector<bool> &update,
              const std::vector<bool> &project, BandImages &images, int threads);
    // Intensity of a stored 1, in which projections come.
    float unit() const { return unit_ * gain_; }
    void scale(float factor) { gain_ *= factor; }
    void write(const Kernels &kernels, Format format, void *volume, int threads);

    const Shape &shape() const { return shape_; }
    int64_t count() const;
    int64_t bytes() const { return count() * static_cast<int64_t>(sizeof(Values) + sizeof(BlockPosition)); }

private:
    struct Values {
        uint16_t rows[smart_rows][block_columns];
    };
    struct Slab {
        std::vector<BlockPosition> positions;
        std::vector<Values> values;
        BlockList list() {
            return {positions.data(), static_cast<int>(positions.size()), reinterpret_cast<uint16_t *>(values.data())};
        }
    };
    Blocks(const Kernels &kernels, const SmartStart &job, float most, int threads);

    Shape shape_;
    float unit_, gain_ = 1.0f;  // the gain waits for the next update
    std::vector<Slab> slabs_;
};

}  // namespace tomoshadow
