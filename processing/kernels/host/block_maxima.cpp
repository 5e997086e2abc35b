#include "host/block_maxima.hpp"

#include <algorithm>
#include <vector>

#include "host/parallel.hpp"

namespace tomoshadow {

namespace {

// Voxels as whole numbers, which have the same order and which every processor compares many at a time.
template <class Number>
class Layer {
public:
    Layer(const BlockMaxima &job, int layer)
        : job_(job),
          z0_(layer * job.factor),
          z_end_(std::min(z0_ + job.factor, job.shape.nz)),
          maxima_(static_cast<Number *>(job.maxima) + static_cast<int64_t>(layer) * job.rows * job.columns),
          highest_(static_cast<size_t>(job.shape.nx)) {}

    void add() {
        for (int row = 0; row < job_.shape.ny;) {
            const int block = (job_.first_row + row) / job_.factor;
            const int end = std::min((block + 1) * job_.factor - job_.first_row, job_.shape.ny);
            look(row, end);
            put(maxima_ + static_cast<int64_t>(block) * job_.columns);
            row = end;
        }
    }

private:
    void look(int row, int end) {
        std::fill(highest_.begin(), highest_.end(), Number{});
        Number *highest = highest_.data();
        const int nx = job_.shape.nx;
        for (int z = z0_; z < z_end_; ++z) {
            const Number *voxels = static_cast<const Number *>(job_.slab) + z * job_.plane + static_cast<int64_t>(row) * nx;
            for (int y = row; y < end; ++y, voxels += nx)
                for (int x = 0; x < nx; ++x) highest[x] = std::max(highest[x], voxels[x]);
        }
    }
    void put(Number *maxima) const {
        const int nx = job_.shape.nx;
        for (int x = 0; x < nx; x += job_.factor, ++maxima)
            *maxima = std::max(*maxima, *std::max_element(&highest_[static_cast<size_t>(x)],
                                                          highest_.data() + std::min(x + job_.factor, nx)));
    }

    const BlockMaxima &job_;
    const int z0_, z_end_;
    Number *const maxima_;
    std::vector<Number> highest_;  // of a row of blocks, column by column
};

template <class Number>
void add_layers(const BlockMaxima &job, int threads) {
    for_each((job.shape.nz + job.factor - 1) / job.factor, threads, [&](int layer) { Layer<Number>(job, layer).add(); });
}

}  // namespace

void add_block_maxima(const BlockMaxima &job, int threads) {
    if (job.format == Format::single) return add_layers<int32_t>(job, threads);
    if (job.format == Format::half) return add_layers<int16_t>(job, threads);
    add_layers<uint8_t>(job, threads);
}

}  // namespace tomoshadow
