"""Intensity volumes from preprocessed images: line of sight and iterative methods."""
