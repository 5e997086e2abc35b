// Runs line of sight on small random cases without Python, for sanitizers and other processors: prints what comes out.
// All memory is on the heap and no larger than the binding demands, so that a sanitizer sees every step beyond it.
#include <cstdio>
#include <memory>

#include "bands.hpp"
#include "bricks.hpp"
#include "images.hpp"
#include "instruction_set.hpp"

using namespace tomoshadow;

namespace {

// The same numbers on every machine.
class Random {
public:
    explicit Random(uint32_t seed) : state_(seed) {}
    double uniform(double low, double high) {
        state_ = state_ * 1664525u + 1013904223u;
        return low + (high - low) * (state_ >> 8) / 16777216.0;
    }
    int below(int end) { return static_cast<int>(uniform(0, end)); }

private:
    uint32_t state_;
};

constexpr int overhang = 34;

struct Scene {
    Shape shape;
    std::vector<std::vector<int16_t>> pixels;
    std::vector<std::vector<double>> planes;
    std::vector<std::vector<float>> nodes;
    std::vector<OccupiedCells> cells;
    std::vector<View> views;

    Scene(Random &random, int n_views) {
        shape = {1 + random.below(20), 1 + random.below(40), 1 + random.below(90)};
        for (int i = 0; i < n_views; ++i) random.below(3) ? add_rectified(random) : add_mapped(random);
    }

private:
    View &add_image(Random &random, int rows, int columns) {
        std::vector<int16_t> image(static_cast<size_t>(rows) * columns);
        const int dark = random.below(columns / 4);
        for (size_t k = 0; k < image.size(); ++k)
            image[k] = static_cast<int>(k % columns) < dark ? 0 : static_cast<int16_t>(random.uniform(0, 32767.9));
        pixels.push_back(std::move(image));
        cells.push_back(occupied_cells(pixels.back().data(), rows, columns));
        View view{};
        view.pixels = pixels.back().data();
        view.rows = rows;
        view.columns = columns;
        view.unit = 1.0f / 32767;
        view.occupancy = {cells.back().sums.data(), cells.back().columns};
        views.push_back(view);
        return views.back();
    }
    void add_rectified(Random &random) {
        const double scale = random.uniform(0.6, 1.7), slope = random.uniform(0, 0.5);
        const int last = (shape.nx + block_columns - 1) / block_columns * block_columns - 1;
        std::vector<double> scales, shifts_u, shifts_v;
        for (int z = 0; z < shape.nz; ++z) {
            scales.push_back(scale - 0.001 * z);
            shifts_u.push_back(1.3 + slope * z);
            shifts_v.push_back(0.7 + 0.1 * z);
        }
        View &view = add_image(random, static_cast<int>(scale * (shape.ny - 1) + shifts_v.back()) + 3,
                               static_cast<int>(scale * last + shifts_u.back()) + overhang);
        planes.push_back(std::move(scales));
        view.scale = planes.back().data();
        planes.push_back(std::move(shifts_u));
        view.shift_u = planes.back().data();
        planes.push_back(std::move(shifts_v));
        view.shift_v = planes.back().data();
    }
    void add_mapped(Random &random) {
        const int spacing = 16 >> random.below(4), nz = (shape.nz - 1) / spacing + 2, ny = (shape.ny - 1) / spacing + 2,
                  nx = (shape.nx - 1) / spacing + 2;
        const int rows = 20 + random.below(60), columns = 40 + random.below(100);
        View &view = add_image(random, rows, columns);
        const double roll[] = {random.uniform(-1, 1), random.uniform(-1, 1)};
        std::vector<float> lattice;
        for (int channel = 0; channel < 3; ++channel)
            for (int z = 0; z < nz; ++z)
                for (int y = 0; y < ny; ++y)
                    for (int x = 0; x < nx; ++x) {
                        const double along = spacing * (roll[0] * x + roll[1] * y), across = spacing * (roll[0] * y - roll[1] * x);
                        lattice.push_back(static_cast<float>(channel == 0 ? 20 + along + z : channel == 1 ? 10 + across : 1));
                    }
        nodes.push_back(std::move(lattice));
        view.nodes = nodes.back().data();
        view.nodes_z = nz;
        view.nodes_y = ny;
        view.nodes_x = nx;
        view.spacing = spacing;
    }
};

double sum_of(const Shape &shape, const float *values) {
    double sum = 0;
    for (int64_t k = 0; k < static_cast<int64_t>(shape.nz) * shape.ny * shape.nx; ++k) sum += values[k];
    return sum;
}

void run(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 2654435761u + 1);
    const int n_views = 2 + number % 7;
    const Scene scene(random, n_views);
    const Shape &shape = scene.shape;
    const auto method = static_cast<Method>(random.below(3));
    const size_t voxels = static_cast<size_t>(shape.nz) * shape.ny * shape.nx;
    const std::unique_ptr<float[]> volume(new float[voxels]), sum(new float[voxels]());
    for (Format format : {Format::half, Format::byte}) {
        const std::unique_ptr<uint8_t[]> bytes(new uint8_t[voxels * bytes_of(format)]);
        run_line_of_sight(kernels, {scene.views.data(), n_views, shape, 0, method, format, bytes.get()}, 2);
    }
    run_line_of_sight(kernels, {scene.views.data(), n_views, shape, 0, method, Format::single, volume.get()}, 2);
    std::vector<View> exposures;
    for (int e = 0; e < 5; ++e) exposures.insert(exposures.end(), scene.views.begin(), scene.views.end());
    run_sum_of_sight(kernels, {exposures.data(), n_views, 5, shape, method, sum.get()}, 2);
    const Bricks bricks = bricks_of_sight(kernels, {scene.views.data(), n_views, shape, method, 0.0f}, 2);
    std::printf("%d %s %.6f %.6f %zu\n", number, kernels.name, sum_of(shape, volume.get()), sum_of(shape, sum.get()),
                bricks.positions.size() / 3);
}

}  // namespace

int main() {
    const Kernels &kernels = selected_kernels();
    for (int number = 0; number < 60; ++number) run(kernels, number);
}
