"""Intensity volumes from preprocessed images: line of sight and iterative methods, slab by slab.

``planning`` holds what does not depend on the images. It may import ``kernels``, ``preprocessing`` and geometry.
"""
