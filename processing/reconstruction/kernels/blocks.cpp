#include "blocks.hpp"

#include <algorithm>
#include <cstring>

#include "bands.hpp"

namespace tomoshadow {

void Blocks::Slab::keep(BlockPosition position, const float *from) {
    positions.push_back(position);
    values.emplace_back();
    std::memcpy(&values.back(), from, sizeof(Values));
}

Blocks::Blocks(const Shape &shape) : shape_(shape), slabs_((shape.ny + smart_rows - 1) / smart_rows) {}

Blocks Blocks::of_views(const Kernels &kernels, const std::vector<View> &views, const Shape &shape, float floor,
                        int threads) {
    Blocks blocks(shape);
    const auto keep = [](void *slab, BlockPosition position, const float *values) {
        static_cast<Slab *>(slab)->keep(position, values);
    };
    const SmartStart job{views.data(), static_cast<int>(views.size()), shape, floor};
    for_each(static_cast<int>(blocks.slabs_.size()), threads,
             [&](int slab) { kernels.smart_start(job, slab, keep, &blocks.slabs_[slab]); });
    return blocks;
}

Blocks Blocks::of_volume(const float *volume, const Shape &shape, int threads) {
    Blocks blocks(shape);
    for_each(static_cast<int>(blocks.slabs_.size()), threads, [&](int slab) {
        const int y0 = slab * smart_rows, rows = std::min(smart_rows, shape.ny - y0);
        for (int z = 0; z < shape.nz; ++z)
            for (int x0 = 0; x0 < shape.nx; x0 += block_columns) {
                Values values{};
                const int columns = std::min(block_columns, shape.nx - x0);
                bool any = false;
                for (int row = 0; row < rows; ++row) {
                    const float *from = volume + (static_cast<int64_t>(z) * shape.ny + y0 + row) * shape.nx + x0;
                    std::copy(from, from + columns, values.rows[row]);
                    any |= std::any_of(from, from + columns, [](float value) { return value != 0.0f; });
                }
                if (any) blocks.slabs_[slab].keep({z, x0}, values.rows[0]);
            }
    });
    return blocks;
}

void Blocks::pass(const Kernels &kernels, const std::vector<View> &views, const bool *update,
                  const std::vector<float *> &sums, int threads) {
    const SmartPass job{views.data(), update, static_cast<int>(views.size()), shape_};
    run_bands(job, sums, threads, [&](int slab, const Projection *projections) {
        kernels.smart_pass(job, slab, slabs_[slab].list(), projections);
    });
}

void Blocks::scale(float factor, int threads) {
    for_each(static_cast<int>(slabs_.size()), threads, [&](int slab) {
        for (Values &values : slabs_[slab].values)
            for (auto &row : values.rows)
                for (float &value : row) value *= factor;
    });
}

void Blocks::write(const Kernels &kernels, Format format, void *volume, int threads) {
    for_each(static_cast<int>(slabs_.size()), threads, [&](int slab) {
        kernels.write_blocks(shape_, slab, slabs_[slab].list(), format, volume);
    });
}

int64_t Blocks::count() const {
    int64_t count = 0;
    for (const Slab &slab : slabs_) count += static_cast<int64_t>(slab.positions.size());
    return count;
}

}  // namespace tomoshadow
