// SMART: what blocks look like from some views, and the ratios that correct them.
#pragma once

#include <vector>

#include "host/blocks.hpp"
#include "job.hpp"

namespace tomoshadow {

// What the volume looks like from each view, in parts: bands of slabs project into images of their own, which are added in
// order, so that the sums do not depend on who computed what.
class Projections {
public:
    // The images of the views hold the ratios.
    Projections(std::vector<View> views, const Shape &shape);

    const std::vector<View> &views() const { return views_; }
    const Shape &shape() const { return shape_; }

    // Multiply blocks by the samples of the ratio images of the views to update, which are neighbours, then project them
    // onto the views to project.
    void pass(const Kernels &kernels, Blocks &blocks, const std::vector<bool> &update, const std::vector<bool> &project,
              int threads);
    // The sum of the latest projection onto a view, in units of the volume.
    double sum(int view) const;
    // Set the ratio image of a view from its latest projection: the path and the parts that `job` lacks, in order. Returns
    // the sum of (projected - recorded)^2.
    double correct(const Kernels &kernels, int view, Correction job, int threads) const;

private:
    struct alignas(64) Line {
        float pixels[16];
    };
    class Band {
    public:
        Band(const std::vector<View> &views, const Shape &shape, int first_slab, int end_slab);
        // Where to project: images of zeros for the wanted views, nowhere for others.
        std::vector<Projection> cleared(const std::vector<bool> &wanted);
        const Projection &part(int view) const { return parts_[view]; }

        const int first_slab, end_slab;

    private:
        std::vector<std::vector<Line>> memory_;
        std::vector<Projection> parts_;
    };
    std::vector<Projection> parts(int view) const;

    std::vector<View> views_;
    Shape shape_;
    std::vector<Band> bands_;
};

}  // namespace tomoshadow
