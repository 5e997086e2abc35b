// Gaussian blobs fitted to images by coordinate descent. Residual images are kept up to date while blobs change, so that
// a sweep costs a few small windows per blob and view, and no pass over the images.
#pragma once

#include "job.hpp"
#include "simd/lanes.hpp"
#include "simd/ratios.hpp"
#include "simd/sighting.hpp"

namespace tomoshadow::TOMOSHADOW_ISA {
namespace {

inline Sighting seen_of(const Blobs &blobs, const BlobView &view, const double *position) {
    return seen_at(blobs.grid, view.nodes, view.shift_u, view.shift_v, position);
}

constexpr int most_vectors = max_blob_window / lanes;

// The pixels of an image that a blob reaches, and its shape there.
struct Patch {
    int left, top, vectors, rows;
    bool empty;
    Floats along_u[most_vectors], offset_u[most_vectors];
    float along_v[max_blob_window], offset_v[max_blob_window];
};

// Of the patch of a blob seen at (u, v) the place; it lies within the image, also where the blob is at its edge.
inline void place(Patch &patch, const BlobView &view, double u, double v) {
    const int reach_u = static_cast<int>(blob_reach * view.sigma_u + 1);
    const int reach_v = static_cast<int>(blob_reach * view.sigma_v + 1);
    patch.empty = !(u > -reach_u && v > -reach_v && u < view.columns - 1 + reach_u && v < view.rows - 1 + reach_v);
    if (patch.empty) return;
    patch.vectors = (2 * reach_u + lanes - 1) / lanes;
    patch.rows = 2 * reach_v;
    patch.left = larger(0, smaller(floor_of(u) + 1 - reach_u, view.columns - patch.vectors * lanes));
    patch.top = larger(0, smaller(floor_of(v) + 1 - reach_v, view.rows - patch.rows));
}

inline Floats bell(Floats offset, double sigma) {
    constexpr double half_per_ln2 = 0.72134752044448170368;
    return power_of_2(offset * offset * static_cast<float>(-half_per_ln2 / (sigma * sigma)));
}

inline void shape(Patch &patch, const BlobView &view, double u, double v) {
    for (int k = 0; k < patch.vectors; ++k) {
        patch.offset_u[k] = lane_numbers() + all(static_cast<float>(patch.left + k * lanes - u));
        patch.along_u[k] = bell(patch.offset_u[k], view.sigma_u);
    }
    for (int row = 0; row < patch.rows; row += lanes) {
        const Floats offset = lane_numbers() + all(static_cast<float>(patch.top + row - v));
        store(patch.offset_v + row, offset);
        store(patch.along_v + row, bell(offset, view.sigma_v));
    }
}

inline float *first_pixel(const BlobView &view, const Patch &patch) {
    return view.residual + static_cast<int64_t>(patch.top) * view.columns + patch.left;
}

inline void add(const BlobView &view, const Patch &patch, double amplitude) {
    float *pixels = first_pixel(view, patch);
    for (int row = 0; row < patch.rows; ++row, pixels += view.columns) {
        const Floats height = all(static_cast<float>(amplitude * view.gain) * patch.along_v[row]);
        for (int k = 0; k < patch.vectors; ++k)
            store(pixels + k * lanes, multiply_add(height, patch.along_u[k], load<Floats>(pixels + k * lanes)));
    }
}

// Sums over a patch: residual x shape, the same x offset along u and v, and shape squared.
struct Moments {
    double product, product_u, product_v, shape;
};

inline Moments moments(const BlobView &view, const Patch &patch) {
    Floats level[most_vectors] = {}, slope[most_vectors] = {};
    const float *pixels = first_pixel(view, patch);
    float square_v = 0;
    for (int row = 0; row < patch.rows; ++row, pixels += view.columns) {
        const Floats weight = all(patch.along_v[row]), sloped = all(patch.along_v[row] * patch.offset_v[row]);
        square_v += patch.along_v[row] * patch.along_v[row];
        for (int k = 0; k < patch.vectors; ++k) {
            const Floats residual = load<Floats>(pixels + k * lanes);
            level[k] = multiply_add(weight, residual, level[k]);
            slope[k] = multiply_add(sloped, residual, slope[k]);
        }
    }
    Floats product{}, product_u{}, product_v{}, square_u{};
    for (int k = 0; k < patch.vectors; ++k) {
        const Floats weighted = patch.along_u[k] * level[k];
        product += weighted;
        product_u = multiply_add(weighted, patch.offset_u[k], product_u);
        product_v = multiply_add(patch.along_u[k], slope[k], product_v);
        square_u = multiply_add(patch.along_u[k], patch.along_u[k], square_u);
    }
    return {sum_of(product), sum_of(product_u), sum_of(product_v), sum_of(square_u) * square_v};
}

// Normal equations of one blob. Amplitude and position of a Gaussian do not couple.
struct Normal {
    double amplitude = 0, amplitudes = 0;
    double gradient[3] = {}, matrix[3][3] = {};

    void add(const BlobView &view, const Sighting &seen, const Moments &sums, double blob_amplitude) {
        const double height = blob_amplitude * view.gain;
        const double u = 1 / (view.sigma_u * view.sigma_u), v = 1 / (view.sigma_v * view.sigma_v);
        amplitude += view.gain * sums.product;
        amplitudes += view.gain * view.gain * sums.shape;
        for (int i = 0; i < 3; ++i) {
            gradient[i] += height * (sums.product_u * u * seen.along_u[i] + sums.product_v * v * seen.along_v[i]);
            for (int j = i; j < 3; ++j)
                matrix[i][j] += height * height * sums.shape / 2 *
                                (u * seen.along_u[i] * seen.along_u[j] + v * seen.along_v[i] * seen.along_v[j]);
        }
    }

    // Step of the position, no longer than allowed; none where the views do not say enough.
    bool step(const BlobSweeps &sweeps, int n_views, double *moved) const {
        const double damping = sweeps.damping * sweeps.scale * sweeps.scale * amplitudes / (2 * n_views);
        const double a = matrix[0][0] + damping, b = matrix[1][1] + damping, c = matrix[2][2] + damping;
        const double d = matrix[0][1], e = matrix[0][2], f = matrix[1][2];
        const double inverse[3][3] = {{b * c - f * f, e * f - d * c, d * f - e * b},
                                      {e * f - d * c, a * c - e * e, d * e - a * f},
                                      {d * f - e * b, d * e - a * f, a * b - d * d}};
        const double determinant = a * inverse[0][0] + d * inverse[0][1] + e * inverse[0][2];
        double length = 0;
        for (int i = 0; i < 3; ++i) {
            moved[i] = (inverse[i][0] * gradient[0] + inverse[i][1] * gradient[1] + inverse[i][2] * gradient[2]) / determinant;
            length += moved[i] * moved[i];
        }
        length = __builtin_sqrt(length);
        if (!(determinant > 0 && length < 1e30)) return false;
        if (length > sweeps.max_step)
            for (int i = 0; i < 3; ++i) moved[i] *= sweeps.max_step / length;
        return true;
    }
};

// A blob as all views see it.
class SeenBlob {
public:
    SeenBlob(const Blobs &blobs, const double *position, double amplitude) : blobs_(blobs), amplitude_(amplitude) {
        for (int view = 0; view < blobs.n_views; ++view) see(view, position);
    }
    void see(int view, const double *position) {
        seen_[view] = seen_of(blobs_, blobs_.views[view], position);
        place(patches_[view], blobs_.views[view], seen_[view].u, seen_[view].v);
        if (!patches_[view].empty) shape(patches_[view], blobs_.views[view], seen_[view].u, seen_[view].v);
    }
    Normal normal() const {
        Normal normal;
        for (int view = 0; view < blobs_.n_views; ++view)
            if (!patches_[view].empty) {
                const Moments sums = moments(blobs_.views[view], patches_[view]);
                normal.add(blobs_.views[view], seen_[view], sums, amplitude_);
            }
        return normal;
    }
    void add_to_residuals(double amplitude) const {
        for (int view = 0; view < blobs_.n_views; ++view)
            if (!patches_[view].empty) add(blobs_.views[view], patches_[view], amplitude);
    }
    void replace(const double *position, double amplitude, bool moved) {
        if (!moved) return add_to_residuals(amplitude_ - amplitude);
        add_to_residuals(amplitude_);
        for (int view = 0; view < blobs_.n_views; ++view) see(view, position);
        add_to_residuals(-amplitude);
    }

private:
    const Blobs &blobs_;
    double amplitude_;
    Sighting seen_[max_views];
    Patch patches_[max_views];
};

// Fits one blob, all others fixed; whether it changed.
inline bool fit_blob(const Blobs &blobs, const BlobSweeps &sweeps, int64_t number) {
    double *position = blobs.positions + 3 * number, &amplitude = blobs.amplitudes[number];
    SeenBlob blob(blobs, position, amplitude);
    const Normal normal = blob.normal();
    if (!(normal.amplitudes > 0)) {
        blob.add_to_residuals(amplitude);
        amplitude = 0;
        return false;
    }
    const double fitted = amplitude + normal.amplitude / normal.amplitudes, next = fitted > 0 ? fitted : 0;
    double step[3];
    const bool moved = sweeps.move && amplitude > 0 && normal.step(sweeps, blobs.n_views, step);
    double change = (next > amplitude ? next - amplitude : amplitude - next) / sweeps.scale;
    if (moved)
        for (int i = 0; i < 3; ++i) {
            position[i] += step[i];
            change = step[i] > change ? step[i] : -step[i] > change ? -step[i] : change;
        }
    blob.replace(position, next, moved);
    amplitude = next;
    return change > sweeps.tolerance;
}

int sweep_blobs(const Blobs &blobs, const BlobSweeps &sweeps) {
    for (int sweep = 0; sweep < sweeps.most; ++sweep) {
        const bool everybody = sweep % all_again == 0;
        bool any = false;
        for (int64_t number = 0; number < blobs.count; ++number)
            if (everybody || sweeps.awake[number]) {
                sweeps.awake[number] = fit_blob(blobs, sweeps, number);
                any = any || sweeps.awake[number];
            }
        if (everybody && !any) return sweep + 1;
    }
    return sweeps.most;
}

inline bool see_blob(const Blobs &blobs, const BlobView &view, int64_t number, Patch &patch) {
    const Sighting seen = seen_of(blobs, view, blobs.positions + 3 * number);
    place(patch, view, seen.u, seen.v);
    if (patch.empty) return false;
    shape(patch, view, seen.u, seen.v);
    return true;
}

void draw_blobs(const Blobs &blobs, int view, double factor) {
    Patch patch;
    for (int64_t number = 0; number < blobs.count; ++number)
        if (blobs.amplitudes[number] != 0 && see_blob(blobs, blobs.views[view], number, patch))
            add(blobs.views[view], patch, factor * blobs.amplitudes[number]);
}

inline double residual_square(const BlobView &view, const Patch &patch) {
    Floats squares{};
    const float *pixels = first_pixel(view, patch);
    for (int row = 0; row < patch.rows; ++row, pixels += view.columns)
        for (int k = 0; k < patch.vectors; ++k) {
            const Floats residual = load<Floats>(pixels + k * lanes);
            squares = multiply_add(residual, residual, squares);
        }
    return sum_of(squares);
}

void weigh_blobs(const Blobs &blobs, int view, BlobSupport *support) {
    Patch patch;
    for (int64_t number = 0; number < blobs.count; ++number) {
        support[number] = {0, 0, 0, 0};
        if (!see_blob(blobs, blobs.views[view], number, patch)) continue;
        const Moments sums = moments(blobs.views[view], patch);
        support[number] = {sums.product, sums.shape, residual_square(blobs.views[view], patch),
                           static_cast<double>(patch.rows) * patch.vectors * lanes};
    }
}

}  // namespace
}  // namespace tomoshadow::TOMOSHADOW_ISA
