// What the kernels work on: plain descriptions of memory that the binding keeps alive.
#pragma once

#include <cstdint>

namespace tomoshadow {

// Volumes are (z, y, x), images (row, column), both contiguous.
struct Shape {
    int nz, ny, nx;
};

struct Image {
    const float *pixels;
    int rows, columns;
};

// One view. Either rectified: voxel (x, y) of plane z is seen at column scale[z] x + shift_u[z] and row
// scale[z] y + shift_v[z] of the image. Or mapped by nodes: channels u, v, area on a lattice of every
// `spacing`-th voxel, linear in between; `area` is the pixel area of a voxel, seen along z.
struct View {
    Image image;
    const double *scale, *shift_u, *shift_v;  // rectified, else null
    const float *nodes;                       // (3, nodes_z, nodes_y, nodes_x), else null
    int nodes_z, nodes_y, nodes_x, spacing;
};

enum class Method { geometric_mean, minimum, product };

struct LineOfSight {
    const View *views;
    int n_views;
    Shape shape;
    Method method;
    float *volume;        // one of the two
    uint16_t *volume_16;  // IEEE half precision
};

// Rows [first_row, first_row + rows) of a view's image that a band of the volume projects onto.
struct Projection {
    float *pixels;
    int first_row, rows, columns;
};

// One SMART pass: multiply the volume by the samples of the ratio images, then project the result.
struct SmartPass {
    const View *views;  // their images hold the ratios
    const bool *update;
    const bool *project;
    int n_views;
    Shape shape;
    float *volume;
};

// Kernels work on slabs of rows of constant y over all z; a band is a run of slabs.
constexpr int slab_rows = 8;

struct Kernels {
    const char *name;
    void (*line_of_sight)(const LineOfSight &job, int slab);
    void (*smart_pass)(const SmartPass &job, int slab, const Projection *projections);
};

}  // namespace tomoshadow
