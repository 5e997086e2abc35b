#include "host/blobs.hpp"

#include <algorithm>

namespace tomoshadow {

namespace {

constexpr int at_once = 16;  // voxels that are compared with the threshold together

bool any_above(const float *voxels, int count, float threshold) {
    int above = 0;
    for (int k = 0; k < count; ++k) above |= voxels[k] >= threshold;
    return above;
}

bool is_peak(const float *volume, const Shape &shape, int z, int y, int x) {
    const int64_t row = shape.nx, plane = row * shape.ny;
    const int64_t own = z * plane + y * row + x;
    for (int pz = std::max(z - 1, 0); pz <= std::min(z + 1, shape.nz - 1); ++pz)
        for (int py = std::max(y - 1, 0); py <= std::min(y + 1, shape.ny - 1); ++py)
            for (int px = std::max(x - 1, 0); px <= std::min(x + 1, shape.nx - 1); ++px) {
                const int64_t other = pz * plane + py * row + px;
                if (volume[other] > volume[own] || (volume[other] == volume[own] && other < own)) return false;
            }
    return true;
}

}  // namespace

std::vector<Peak> find_peaks(const float *volume, const Shape &shape, int first_row, int end_row, float threshold) {
    std::vector<Peak> peaks;
    for (int z = 0; z < shape.nz; ++z)
        for (int y = first_row; y < end_row; ++y) {
            const float *voxels = volume + (static_cast<int64_t>(z) * shape.ny + y) * shape.nx;
            for (int begin = 0; begin < shape.nx; begin += at_once) {
                const int end = std::min(begin + at_once, shape.nx);
                if (!any_above(voxels + begin, end - begin, threshold)) continue;
                for (int x = begin; x < end; ++x)
                    if (voxels[x] >= threshold && is_peak(volume, shape, z, y, x))
                        peaks.push_back({double(x), double(y), double(z), voxels[x]});
            }
        }
    return peaks;
}

}  // namespace tomoshadow
