#include "host/bricks.hpp"

#include "host/smart.hpp"

namespace tomoshadow {

namespace {

constexpr size_t brick_size = sight_rows * block_columns;

struct Slab {
    int y0 = 0;
    Bricks bricks;
    static void keep(void *owner, int z, int x0, const uint16_t *values) {
        auto *slab = static_cast<Slab *>(owner);
        const int32_t position[] = {z, slab->y0, x0};
        slab->bricks.positions.insert(slab->bricks.positions.end(), position, position + 3);
        slab->bricks.values.insert(slab->bricks.values.end(), values, values + brick_size);
    }
};

}  // namespace

Bricks bricks_of_sight(const Kernels &kernels, const SparseSight &job, int threads) {
    std::vector<Slab> slabs((job.shape.ny + sight_rows - 1) / sight_rows);
    for_each(static_cast<int>(slabs.size()), threads, [&](int number) {
        slabs[number].y0 = number * sight_rows;
        kernels.sparse_sight(job, number, &Slab::keep, &slabs[number]);
    });
    size_t count = 0;
    for (const Slab &slab : slabs) count += slab.bricks.positions.size() / 3;
    Bricks all;
    all.positions.reserve(3 * count);
    all.values.reserve(brick_size * count);
    for (Slab &slab : slabs) {  // given back one by one, so that nothing is in memory twice
        const Bricks part = std::move(slab.bricks);
        all.positions.insert(all.positions.end(), part.positions.begin(), part.positions.end());
        all.values.insert(all.values.end(), part.values.begin(), part.values.end());
    }
    return all;
}

}  // namespace tomoshadow
