// What the kernels work on: plain descriptions of memory that the binding keeps alive.
#pragma once

#include <cstdint>

namespace tomoshadow {

// Throws std::bad_alloc; kernels have nothing of the standard library.
[[noreturn]] void out_of_memory();

// Volumes are (z, y, x), images (row, column), both contiguous.
struct Shape {
    int nz, ny, nx;
};

// Kernels work on slabs of rows of constant y over all z, block by block.
constexpr int block_columns = 32;
constexpr int sight_rows = 16;  // rows of a slab for line of sight ...
constexpr int smart_rows = 8;   // ... and for SMART, whose blocks come and go with the droplets

constexpr int max_views = 8;

// Pixels per voxel of a rectified view, and voxels per pixel, which the windows of all instruction sets have room for.
constexpr double max_scale = 1.8;

// Columns that a rectified image has from the one on in which the last voxel of a block is seen, which the widest vectors
// may read, and rows from that of the last voxel on.
constexpr int overhang_columns = 36, overhang_rows = 4;

// Voxels from node to node of a mapping that is sampled at nodes.
constexpr int node_spacings[] = {16, 8, 4, 2};

// SMART works through a slab tile by tile: what the views see of a tile stays in the nearest cache for all its planes.
constexpr int smart_planes = 16, smart_columns = 256;

// Rows and columns of an image, ends included.
struct PixelBox {
    int top, bottom, left, right;
};

// Cells of pixels, the last row and column not included.
struct CellBox {
    int top, bottom, left, right;
};

// Where an image is not zero: sums[y][x] counts the cells above y and left of x in which any pixel is not zero, so that
// four of them tell whether a box of any size is empty.
struct Occupancy {
    static constexpr int cell_rows = 4, cell_columns = 8;
    const int32_t *sums;  // null: nobody looked
    int columns;
    bool any(const CellBox &box) const {
        const int32_t *top = sums + static_cast<int64_t>(box.top) * columns;
        const int32_t *bottom = sums + static_cast<int64_t>(box.bottom) * columns;
        return bottom[box.right] - bottom[box.left] != top[box.right] - top[box.left];
    }
};

// How far the line of sight through pixel (u, v) goes in one plane of voxels, 1 / |cos| of its angle to z:
// sqrt(1 + ((u - foot_u)^2 + (v - foot_v)^2) per_distance^2). A rectified image is what a camera sees that looks along z,
// right above its pixel (foot_u, foot_v), from a distance of 1 / per_distance pixels.
struct Path {
    float foot_u, foot_v, per_distance;
};

// One view: an image in fixed point, `unit` times a pixel (0 .. 32767) is an intensity; and where voxels are seen
// in it. Either rectified: voxel (x, y) of plane z is seen at column scale[z] x + shift_u[z] and row
// scale[z] y + shift_v[z]. Or mapped by nodes: channels u, v, area on a lattice of every `spacing`-th voxel,
// linear in between; `area` is the pixel area of a voxel, seen along the line of sight, and all paths are 1.
struct View {
    const int16_t *pixels;
    int rows, columns;
    float unit;
    Occupancy occupancy;
    const double *scale, *shift_u, *shift_v;  // rectified, else null
    Path path;
    const float *nodes;                       // (3, nodes_z, nodes_y, nodes_x), else null
    int nodes_z, nodes_y, nodes_x, spacing;
};

enum class Method { geometric_mean, minimum, product };
enum class Format { single, half, byte };  // float32, float16, or 0 .. 255 for 0 .. 1

constexpr int bytes_of(Format format) { return format == Format::single ? 4 : format == Format::half ? 2 : 1; }

// Row and column of a grid where a volume begins that is a part of it; the column is the first one of a block.
struct Corner {
    int row, column;
};

struct LineOfSight {
    const View *views;
    int n_views;
    Shape shape;
    Corner first;
    Method method;
    Format format;
    void *volume;
};

// The sum of many exposures of the same views, which share their geometry: views[exposure * n_views + i].
struct SumOfSight {
    const View *views;
    int n_views, n_exposures;
    Shape shape;
    Corner first;
    Method method;
    bool mean;      // the volume becomes the mean; else the sum is added to it
    float *volume;
};

constexpr int max_bands = 16;  // of slabs, which project into images of their own

// Rows [first_row, first_row + rows) of a view's image that a band of the volume projects onto, and a spare one;
// without pixels if nobody asked for the view.
struct Projection {
    float *pixels;
    int first_row, rows;
    int64_t stride;  // floats from row to row, a multiple of the widest vector
};

// Blocks of a slab of SMART, ordered by tile, in it by plane and column. Voxels are as in voxels.hpp; those beyond the volume
// are zero.
struct BlockPosition {
    int32_t z, x0;
};
struct BlockList {
    static constexpr int per_chunk = 2048;
    static constexpr int64_t size = smart_rows * block_columns;
    const BlockPosition *positions;
    int count;
    uint16_t *const *chunks;  // each (per_chunk, smart_rows, block_columns)
    uint16_t *voxels(int block) const { return chunks[block / per_chunk] + block % per_chunk * size; }
};

// A list that grows: voxels are written to the next block, which is kept or not.
struct NewBlocks {
    void *owner;
    uint16_t *(*next)(void *owner);
    void (*keep)(void *owner, BlockPosition position);
};

// Find the blocks that exceed `floor` somewhere, in a volume or, where that is null, in a power of the product of what
// views see. They are stored times `gain`.
struct BlockSearch {
    const View *views;
    int n_views;
    const float *volume;
    Shape shape;
    float exponent, floor, gain;
};

// One SMART pass: multiply the blocks by the samples of the ratio images and a gain, then project the result.
struct SmartPass {
    const View *views;  // their images hold the ratios
    int n_views;
    int first_update, n_updates;  // whose ratios multiply the blocks
    float gain;                   // of the volume, in an update
    Shape shape;
};

// The ratio image of a view: (recorded / projected)^exponent; the projection is the sum of its parts, times `unit` and
// the path of each line of sight.
struct Correction {
    Path path;
    const int16_t *recorded;
    float recorded_unit, unit, exponent, ratio_counts;  // ratio_counts: of the ratio 1
    int rows, columns;
    const Projection *parts;
    int n_parts;
    int16_t *ratio;
};

// Where the rows of an image are not zero: a byte for every few columns.
struct FilledCells {
    static constexpr int columns = 8, most = 8;  // so many are looked at together
    static int64_t stride(int image_columns) { return image_columns / columns + most; }
};

// Resample rows [first_row, end_row) of `to` from a recorded image in fixed point, by cubic convolution. Nodes are
// pairs (u, v) for every node_spacing-th pixel of `to`, linear in between. The recorded image has a margin of zeros.
struct Resampling {
    static constexpr int node_spacing = 16, margin = 64;
    const int16_t *from;
    const uint8_t *filled;  // of every row of `from`, see FilledCells
    int from_rows, from_columns;  // with margins
    float origin_u, origin_v;  // of the recorded image, in `from`
    const float *nodes;
    int nodes_x;
    int16_t *to;
    int columns;  // of `to`, a multiple of node_spacing
};

// A recorded exposure, all arrays contiguous and of the same shape. Its light is what it recorded less the dark image:
// divided by that of the background and inverted, or, without one, by the full scale.
struct Exposure {
    enum class Grey { byte, word, single };  // uint8, uint16, float32
    const void *pixels;
    Grey grey;
    int rows, columns;
    const float *dark, *background;  // or null
    float full_scale;
    int window;         // edge of the sliding minimum in pixels; 0: none
    float noise_floor;  // of the intensity
    float *intensity;   // the result; meanwhile minima and their means
};

constexpr int max_blob_window = 64;    // columns and rows of an image that a blob may reach
constexpr double blob_reach = 3.6;     // in sigma: where a blob ends

// A view of Gaussian blobs. Its residual is what was recorded less all blobs. A blob of amplitude a that is seen at
// (u, v) adds a gain exp(-((column - u) / sigma_u)^2 / 2 - ((row - v) / sigma_v)^2 / 2). Nodes are pairs (u, v).
struct BlobView {
    float *residual;
    int rows, columns;    // max_blob_window or more
    const double *nodes;  // (nodes_z, nodes_y, nodes_x, 2)
    double shift_u, shift_v, gain, sigma_u, sigma_v;
};

// Views of a volume are known at every `spacing`-th voxel, linear in between.
struct NodeGrid {
    int nodes_z, nodes_y, nodes_x, spacing;
};

struct Blobs {
    const BlobView *views;
    int n_views;
    NodeGrid grid;
    double *positions;   // (count, 3): x, y, z in voxels
    double *amplitudes;  // (count)
    int64_t count;
};

// How blobs are fitted, one after the other, all others fixed: amplitudes alone, or positions too.
struct BlobSweeps {
    int most;          // sweeps over all blobs
    bool move;
    double scale;      // a typical amplitude
    double damping;    // of positions, relative to what a blob of that amplitude is held by
    double max_step;   // in voxels, per sweep
    double tolerance;  // of amplitudes relative to the typical one, and of positions in voxels: less is no change
    uint8_t *awake;    // (count): blobs that changed in the last sweep
};

// What a view says of a blob: sums over its window of residual x shape, shape squared, residual squared, and pixels.
struct BlobSupport {
    double product, shape, residual, pixels;
};

// Shadows of opaque discs, in units of the blur: a table of rows of equal radius, 16 per octave, over nodes that are equally
// apart in the square of the distance, from where the shadow begins to be whole, a reach within the edge or at the centre,
// to as much beyond the edge. The light decides on the table and its reach.
constexpr int disc_rows = 177, disc_nodes = 96;  // the last two nodes are beyond the disc
constexpr int disc_rows_per_octave = 16;
constexpr double least_blur_px = 0.2;
constexpr double smallest_disc = 0.05, largest_disc = 102.4;  // radii of the first and the last row

// A row of the table: binary logarithm of the transmission; the change of the natural one with distance, over distance; and
// with the radius squared.
struct DiscProfile {
    float log_transmission[disc_nodes], pull[disc_nodes], growth[disc_nodes];
};

// A view of opaque discs. Its transmission is the product of those of all discs; `log_transmission` is the binary logarithm.
struct DiscView {
    float *log_transmission;
    const float *image, *weight;  // what was recorded, and one over its variance, 0 where nothing is known
    int rows, columns;            // 64 or more
    const double *nodes;          // (nodes_z, nodes_y, nodes_x, 2)
    double shift_u, shift_v;
    double variance[3];  // of the blur in px^2: constant, and times z and z^2 in voxels
};

// Discs in a volume. Nodes are pairs (u, v).
struct Discs {
    const DiscView *views;
    int n_views;
    NodeGrid grid;
    const DiscProfile *profiles;  // (disc_rows)
    double reach;                 // of the profiles, in blurs
    double *positions;            // (count, 3): x, y, z in voxels
    double *squares;              // (count): of the radii, in voxels^2
    int64_t count;
};

// How discs are fitted, one after the other, all others fixed: their sizes alone, or positions too.
struct DiscSweeps {
    int most;  // sweeps over all discs
    bool move;
    double damping;    // of positions: information per voxel^2 that holds each where it is
    double largest;    // square of a radius
    double tolerance;  // of positions and radii in voxels: less is no change
    uint8_t *awake;    // (count): discs that changed in the last sweep
    double *information;  // (count): result, on the squares with positions fixed, when a disc was last fitted
};

// What a view says of a disc: weighted sums over its window of products of the transmission's changes with u, v and the
// square of the radius; of the change that the whole disc makes, squared and times the residual; of residuals squared; the
// number of pixels; and of residuals squared, each times what its pixel adds to uu + vv.
struct DiscSupport {
    double uu, uv, vv, us, vs, ss, whole, missing, residual, pixels, placing;
};

constexpr int strip_columns = 64;  // columns that are worked on at once

struct Kernels {
    const char *name;
    void (*line_of_sight)(const LineOfSight &job, int slab);
    void (*sum_of_sight)(const SumOfSight &job, int slab);
    void (*find_blocks)(const BlockSearch &job, int slab, const NewBlocks &blocks);
    void (*write_blocks)(const Shape &shape, int slab, const BlockList &blocks, float unit, Format format, void *volume);
    void (*smart_pass)(const SmartPass &job, int slab, const BlockList &blocks, const Projection *projections);
    double (*correct)(const Correction &job, int row);  // returns the sum of (projected - recorded)^2
    void (*resample)(const Resampling &job, int first_row, int end_row);
    float (*brightest)(const float *pixels, int count);
    void (*quantise)(const float *pixels, float counts_per_unit, int16_t *to, int count);
    void (*find_filled)(const int16_t *pixels, int count, uint8_t *filled);
    void (*row_minima)(const Exposure &job, int first_row, int end_row);
    void (*column_minima)(const Exposure &job, int strip);
    void (*row_means)(const Exposure &job, int first_row, int end_row);
    void (*subtract_veil)(const Exposure &job, int first_row, int end_row);
    void (*draw_blobs)(const Blobs &blobs, int view, double factor);  // residual += factor x blobs
    int (*sweep_blobs)(const Blobs &blobs, const BlobSweeps &sweeps);   // returns how many sweeps it took
    void (*weigh_blobs)(const Blobs &blobs, int view, BlobSupport *support);
    void (*draw_discs)(const Discs &discs, int view, double factor);  // log_transmission += factor x discs
    int (*sweep_discs)(const Discs &discs, const DiscSweeps &sweeps);  // returns how many sweeps it took
    void (*weigh_discs)(const Discs &discs, int view, DiscSupport *support);
};

}  // namespace tomoshadow
