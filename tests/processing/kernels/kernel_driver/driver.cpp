// Runs all kernels on small random cases without Python, for sanitizers and other processors: prints what comes out.
// All memory is on the heap and no larger than the binding demands, so that a sanitizer sees every step beyond it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "host/blobs.hpp"
#include "host/block_maxima.hpp"
#include "host/coverage.hpp"
#include "host/instruction_set.hpp"
#include "host/line_of_sight.hpp"
#include "host/occupancy.hpp"
#include "host/preprocess.hpp"
#include "host/resample.hpp"
#include "host/smart.hpp"
#include "host/stamping.hpp"
#include "host/zero_runs.hpp"

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
        View &view = add_image(random, static_cast<int>(scale * (shape.ny - 1) + shifts_v.back()) + overhang_rows,
                               static_cast<int>(scale * last + shifts_u.back()) + overhang_columns);
        planes.push_back(std::move(scales));
        view.scale = planes.back().data();
        planes.push_back(std::move(shifts_u));
        view.shift_u = planes.back().data();
        planes.push_back(std::move(shifts_v));
        view.shift_v = planes.back().data();
        view.path = {-20.0f, 30.0f, 0.01f};
    }
    void add_mapped(Random &random) {
        const int spacing = node_spacings[random.below(4)], nz = (shape.nz - 1) / spacing + 2, ny = (shape.ny - 1) / spacing + 2,
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

template <class Value>
double sum_of(const Value *values, size_t count) {
    double sum = 0;
    for (size_t k = 0; k < count; ++k) sum += values[k];
    return sum;
}

size_t voxels(const Shape &shape) { return static_cast<size_t>(shape.nz) * shape.ny * shape.nx; }

void look(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 2654435761u + 1);
    const int n_views = 2 + number % 7;
    const Scene scene(random, n_views);
    const Shape &shape = scene.shape;
    const auto method = static_cast<Method>(random.below(3));
    const std::unique_ptr<float[]> volume(new float[voxels(shape)]), sum(new float[voxels(shape)]());
    for (Format format : {Format::half, Format::byte}) {
        const std::unique_ptr<uint8_t[]> bytes(new uint8_t[voxels(shape) * bytes_of(format)]);
        run_line_of_sight(kernels, {scene.views.data(), n_views, shape, {0, 0}, method, format, bytes.get()}, 2);
    }
    run_line_of_sight(kernels, {scene.views.data(), n_views, shape, {0, 0}, method, Format::single, volume.get()}, 2);
    std::vector<View> exposures;
    for (int e = 0; e < 5; ++e) exposures.insert(exposures.end(), scene.views.begin(), scene.views.end());
    run_sum_of_sight(kernels, {exposures.data(), n_views, 5, shape, {0, 0}, method, false, sum.get()}, 2);
    if (shape.nx > block_columns) {
        const Shape part{shape.nz, shape.ny, shape.nx - block_columns};
        const std::unique_ptr<float[]> seen(new float[voxels(part)]);
        run_line_of_sight(kernels, {scene.views.data(), n_views, part, {0, block_columns}, method, Format::single, seen.get()}, 2);
        run_sum_of_sight(kernels, {exposures.data(), n_views, 5, part, {0, block_columns}, method, true, seen.get()}, 2);
    }
    std::printf("sight %d %.6f %.6f\n", number, sum_of(volume.get(), voxels(shape)), sum_of(sum.get(), voxels(shape)));
}

// Two iterations, from MLOS or from a volume.
void iterate(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 2246822519u + 7);
    const int n_views = 2 + number % 7;
    const Scene scene(random, n_views);
    const Shape &shape = scene.shape;
    const std::unique_ptr<float[]> volume(new float[voxels(shape)]);
    for (size_t k = 0; k < voxels(shape); ++k) volume[k] = static_cast<float>(random.uniform(0, 2));
    const float exponent = std::fmin(1.0f, 4.0f / n_views);
    Blocks memory = Blocks::of_volume(kernels, volume.get(), {shape.nx, shape.ny, shape.nz}, 2.0f, 1);
    Blocks blocks = number % 2 ? Blocks::of_volume(kernels, volume.get(), shape, 2.0f, 2)
                               : Blocks::of_views(kernels, scene.views, shape, exponent, 1e-8f, 1.0f, 2, &memory);
    std::vector<std::vector<int16_t>> ratios;
    std::vector<View> corrected = scene.views;
    for (View &view : corrected) {
        ratios.emplace_back(static_cast<size_t>(view.rows) * view.columns);
        view.pixels = ratios.back().data();
        view.unit = 1.0f / 2048;
        view.occupancy = {};
    }
    Projections images(corrected, shape);
    const std::vector<bool> all(n_views, true), none(n_views, false);
    double projected = 0, missed = 0;
    images.pass(kernels, blocks, none, all, 2);
    for (int i = 0; i < n_views; ++i) projected += images.sum(i);
    if (projected > 0) blocks.scale(1000.0f / static_cast<float>(projected * blocks.unit()));
    for (int done = 0; done < 3; ++done) {
        if (done) images.pass(kernels, blocks, all, all, 2);
        missed = 0;
        for (int i = 0; i < n_views; ++i) {
            const View &seen = scene.views[i];
            missed += images.correct(kernels, i,
                                     {{}, seen.pixels, seen.unit, blocks.unit(), 1.0f / static_cast<float>(n_views), 2048.0f,
                                      seen.rows, seen.columns, nullptr, 0, ratios[i].data()},
                                     2);
        }
    }
    blocks.write(kernels, Format::single, volume.get(), 0, shape.ny, 1.0f, 2);
    std::printf("smart %d %.6f %.6f\n", number, sum_of(volume.get(), voxels(shape)), missed);
}

// Positions all over the image, beyond its edges, and such that are not numbers.
void resample(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 3266489917u + 3);
    const int rows = 1 + random.below(60), columns = 1 + random.below(150);
    std::vector<float> image(static_cast<size_t>(rows) * columns);
    for (float &pixel : image) pixel = random.below(2) ? static_cast<float>(random.uniform(0, 1)) : 0.0f;
    const int to_rows = 1 + random.below(70), nodes_y = (to_rows - 1) / 16 + 2, nodes_x = 2 + random.below(8);
    const double roll[] = {random.uniform(-0.5, 2), random.uniform(-0.5, 0.5)};
    const double at[] = {random.uniform(-10, 0.5 * columns), random.uniform(-10, 0.5 * rows)};
    std::vector<float> nodes;
    for (int y = 0; y < nodes_y; ++y)
        for (int x = 0; x < nodes_x; ++x) {
            nodes.push_back(static_cast<float>(at[0] + 16 * (roll[0] * x - roll[1] * y) + random.uniform(-2, 2)));
            nodes.push_back(random.below(40) ? static_cast<float>(at[1] + 16 * (roll[1] * x + roll[0] * y)) : NAN);
        }
    const int to_columns = 16 * (nodes_x - 1);
    const std::unique_ptr<int16_t[]> to(new int16_t[static_cast<size_t>(to_rows) * to_columns]);
    const float unit = tomoshadow::resample(kernels, {image.data(), rows, columns, columns}, nodes.data(), nodes_x, to.get(), to_rows, to_columns, 2);
    const size_t pixels = static_cast<size_t>(to_rows) * to_columns;
    std::printf("resample %d %.6f %.6f\n", number, unit * sum_of(to.get(), pixels), unit * 32767.0);
}

template <class Grey>
std::vector<Grey> grey_image(Random &random, size_t pixels) {
    std::vector<Grey> image(pixels);
    for (Grey &pixel : image) pixel = static_cast<Grey>(random.uniform(0, 255));
    return image;
}

void prepare(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 668265263u + 5);
    const int rows = 1 + random.below(70), columns = 1 + random.below(150);
    const size_t pixels = static_cast<size_t>(rows) * columns;
    const auto bytes = grey_image<uint8_t>(random, pixels);
    const auto words = grey_image<uint16_t>(random, pixels);
    const auto singles = grey_image<float>(random, pixels);
    const auto dark = grey_image<float>(random, pixels), background = grey_image<float>(random, pixels);
    const std::unique_ptr<float[]> intensity(new float[pixels]), minimum(new float[pixels]);
    const void *const recorded[] = {bytes.data(), words.data(), singles.data()};
    const Exposure job{recorded[number % 3], static_cast<Exposure::Grey>(number % 3), rows, columns,
                       random.below(2) ? dark.data() : nullptr, random.below(2) ? background.data() : nullptr, 255.0f,
                       random.below(20), 0.02f, intensity.get()};
    preprocess(kernels, job, 2);
    Exposure alone{singles.data(), Exposure::Grey::single, rows, columns, nullptr, nullptr, 1.0f, 1 + job.window, 0.0f, minimum.get()};
    sliding_minimum(kernels, alone, 2);
    std::printf("prepare %d %.6f %.6f\n", number, sum_of(intensity.get(), pixels), sum_of(minimum.get(), pixels));
}

// Blobs within and beyond a lattice and the images, fitted to noise and drawn; and the peaks of an image as a volume.
void fit_blobs(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 374761393u + 9);
    constexpr int n_views = 3, n_blobs = 40;
    const int nodes = 2 + random.below(3), spacing = 1 << (1 + random.below(4));
    std::vector<std::vector<float>> residuals;
    std::vector<std::vector<double>> lattices;
    std::vector<BlobView> views;
    for (int k = 0; k < n_views; ++k) {
        const int rows = max_blob_window + random.below(20), columns = max_blob_window + random.below(40);
        residuals.push_back(grey_image<float>(random, static_cast<size_t>(rows) * columns));
        lattices.emplace_back();
        for (int z = 0; z < nodes; ++z)
            for (int y = 0; y < nodes; ++y)
                for (int x = 0; x < nodes; ++x) {
                    lattices.back().push_back(spacing * (x + 0.3 * (k - 1) * z) + 20 * k);
                    lattices.back().push_back(spacing * (y + 0.01 * x) + 10);
                }
        views.push_back({residuals[k].data(), rows, columns, lattices[k].data(), 0.1, -0.2, random.uniform(0.5, 2),
                         random.uniform(0.4, 8.6), random.uniform(0.4, 8.6)});
    }
    std::vector<double> positions, amplitudes;
    for (int k = 0; k < 3 * n_blobs; ++k) positions.push_back(random.uniform(-60, nodes * spacing + 60));
    for (int k = 0; k < n_blobs; ++k) amplitudes.push_back(random.uniform(0, 2));
    const Blobs blobs{views.data(), n_views, nodes, nodes, nodes, spacing, positions.data(), amplitudes.data(), n_blobs};
    std::vector<uint8_t> awake(n_blobs);
    kernels.sweep_blobs(blobs, {2, number % 2 == 1, 1.0, 0.02, 0.3, 0.0, awake.data()});
    std::vector<BlobSupport> support(n_blobs);
    double shapes = 0, light = 0;
    for (int k = 0; k < n_views; ++k) {
        kernels.draw_blobs(blobs, k, 1.0);
        kernels.weigh_blobs(blobs, k, support.data());
        for (const BlobSupport &one : support) shapes += one.shape;
        light += sum_of(residuals[k].data(), residuals[k].size());
    }
    const auto peaks = find_peaks(residuals[0].data(), {2, views[0].rows / 2, views[0].columns}, 1, views[0].rows / 2, 200.0f);
    std::printf("blobs %d %.6f %.6f\n", number, light / residuals[0].size(), shapes + static_cast<double>(peaks.size()));
}

// Balls within, across and far beyond the borders of a volume, still and moving.
void stamp(int number) {
    Random random(static_cast<uint32_t>(number) * 2246822519u + 3);
    constexpr int profile_rows = 3, profile_columns = 8;
    const Shape shape{1 + random.below(3), 1 + random.below(20), 1 + random.below(30)};
    std::vector<float> table;
    for (int k = 0; k < profile_rows * profile_columns; ++k)
        table.push_back(static_cast<float>(k % profile_columns == profile_columns - 1 ? 0 : random.uniform(0, 1)));
    std::vector<Stamp> stamps;
    for (int k = 0; k < 30; ++k) {
        const double reach = random.uniform(0, 9), way = k % 2 ? random.uniform(-3, 3) : 0;
        const double far = k % 7 ? 1 : 1e12;
        stamps.push_back({{random.uniform(-2, 4), random.uniform(-9, 30) * far, random.uniform(-9, 40)},
                          {0, way, -way},
                          reach,
                          (profile_columns - 1) / (reach * reach + 1e-9),
                          random.uniform(0, 0.2),
                          double(random.below(profile_rows))});
    }
    const auto voxels = std::make_unique<float[]>(shape.nz * shape.ny * shape.nx);
    const size_t count = static_cast<size_t>(shape.nz) * shape.ny * shape.nx;
    std::fill(voxels.get(), voxels.get() + count, 1.0f);
    stamp_balls(voxels.get(), shape, stamps.data(), 30, {table.data(), profile_rows, profile_columns}, number % 2 == 1);
    std::printf("stamps %d %.6f %.6f\n", number, sum_of(voxels.get(), count), double(count));
}

// Profiles that fall with distance as those of discs do, whatever their radius.
std::vector<DiscProfile> some_profiles() {
    std::vector<DiscProfile> profiles(disc_rows);
    for (int row = 0; row < disc_rows; ++row)
        for (int k = 0; k + 2 < disc_nodes; ++k) {
            const float left = 1.0f - static_cast<float>(k) / (disc_nodes - 2), depth = 0.05f * static_cast<float>(row);
            profiles[row].log_transmission[k] = -depth * left;
            profiles[row].pull[k] = 0.5f * depth;
            profiles[row].growth[k] = -0.1f * left;
        }
    return profiles;
}

// Discs of all sizes within and beyond a lattice and the images, fitted to noise and drawn; and the area they cover.
void fit_discs(const Kernels &kernels, int number) {
    Random random(static_cast<uint32_t>(number) * 2654435769u + 11);
    constexpr int n_views = 2, n_discs = 30;
    const int nodes = 2 + random.below(3), spacing = 1 << (1 + random.below(4));
    static const std::vector<DiscProfile> profiles = some_profiles();
    std::vector<std::vector<float>> logs, images, weights;
    std::vector<std::vector<double>> lattices;
    std::vector<DiscView> views;
    for (int k = 0; k < n_views; ++k) {
        const int rows = 64 + random.below(20), columns = 64 + random.below(40);
        const size_t pixels = static_cast<size_t>(rows) * columns;
        logs.emplace_back(pixels);
        images.emplace_back();
        weights.emplace_back();
        for (size_t pixel = 0; pixel < pixels; ++pixel) {
            images.back().push_back(static_cast<float>(random.uniform(0, 1)));
            weights.back().push_back(static_cast<float>(random.uniform(0, 2)));
        }
        lattices.emplace_back();
        for (int z = 0; z < nodes; ++z)
            for (int y = 0; y < nodes; ++y)
                for (int x = 0; x < nodes; ++x) {
                    lattices.back().push_back(spacing * (x + 0.3 * (2 * k - 1) * z) + 20 * k);
                    lattices.back().push_back(spacing * (y + 0.01 * x) + 10);
                }
        views.push_back({logs[k].data(), images[k].data(), weights[k].data(), rows, columns, lattices[k].data(), 0.1, -0.2,
                         {random.uniform(0.2, 2), random.uniform(-0.01, 0.01), 1e-4}});
    }
    std::vector<double> positions, squares, information(n_discs);
    for (int k = 0; k < 3 * n_discs; ++k) positions.push_back(random.uniform(-60, nodes * spacing + 60));
    for (int k = 0; k < n_discs; ++k) squares.push_back(k % 7 ? random.uniform(0, 9) : random.uniform(0, 1e4));
    const Discs discs{views.data(), n_views, {nodes, nodes, nodes, spacing}, profiles.data(), 3.2,
                      positions.data(), squares.data(), n_discs};
    std::vector<uint8_t> awake(n_discs);
    std::vector<DiscSupport> support(n_discs);
    double light = 0, sizes = 0;
    for (int k = 0; k < n_views; ++k) kernels.draw_discs(discs, k, 1.0);
    kernels.sweep_discs(discs, {2, number % 2 == 1, 0.02, 100.0, 0.0, awake.data(), information.data()});
    for (int k = 0; k < n_views; ++k) {
        kernels.weigh_discs(discs, k, support.data());
        light -= sum_of(logs[k].data(), logs[k].size());
    }
    for (const double square : squares) sizes += square;
    std::vector<float> cells(static_cast<size_t>(4) * 64 * 64);
    cover(positions.data(), squares.data(), n_discs, cells.data(), 64, 64);
    std::printf("discs %d %.6f %.6f\n", number, light / logs[0].size(), sizes + sum_of(cells.data(), cells.size()));
}

void pack(int number) {
    Random random(static_cast<uint32_t>(number) * 2654435769u + 13);
    std::vector<uint32_t> words;
    while (static_cast<int>(words.size()) < 1000 * number) {
        const int length = random.below(200);
        words.insert(words.end(), static_cast<size_t>(length), static_cast<uint32_t>(random.below(3)));
    }
    const std::unique_ptr<uint8_t[]> out(new uint8_t[most_packed_bytes(words.size())]);
    const size_t bytes = pack_zero_runs(words.data(), words.size(), 1, out.get());
    double sum = 0;
    for (size_t k = 0; k < bytes; ++k) sum += out[k];
    std::printf("runs %d %.6f %.6f\n", number, static_cast<double>(bytes), sum);
}

void highest(int number) {
    Random random(static_cast<uint32_t>(number) * 2654435769u + 17);
    const int factor = 1 + random.below(7), first_row = random.below(20);
    const Shape shape{1 + random.below(20), 1 + random.below(20), 1 + random.below(100)};
    const auto blocks = [&](int voxels) { return (voxels + factor - 1) / factor; };
    const int rows = blocks(first_row + shape.ny), columns = blocks(shape.nx);
    std::vector<float> slab, maxima(static_cast<size_t>(blocks(shape.nz)) * rows * columns);
    const auto voxels = static_cast<size_t>(shape.nz) * shape.ny * shape.nx;
    while (slab.size() < voxels) slab.push_back(static_cast<float>(random.uniform(0, 1)));
    add_block_maxima({slab.data(), shape, static_cast<int64_t>(shape.ny) * shape.nx, first_row, factor, maxima.data(), rows,
                      columns, Format::single}, 1 + number % 3);
    std::printf("maxima %d %.6f %.6f\n", number, sum_of(maxima.data(), maxima.size()), sum_of(slab.data(), slab.size()));
}

}  // namespace

int main() {
    const Kernels &kernels = selected_kernels();
    for (int number = 0; number < 21; ++number) look(kernels, number);
    for (int number = 0; number < 14; ++number) iterate(kernels, number);
    for (int number = 0; number < 30; ++number) resample(kernels, number);
    for (int number = 0; number < 30; ++number) prepare(kernels, number);
    for (int number = 0; number < 10; ++number) fit_blobs(kernels, number);
    for (int number = 0; number < 20; ++number) stamp(number);
    for (int number = 0; number < 10; ++number) fit_discs(kernels, number);
    for (int number = 0; number < 20; ++number) pack(number);
    for (int number = 0; number < 20; ++number) highest(number);
}
