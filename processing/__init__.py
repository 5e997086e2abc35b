"""From images to measured volumes. Pure arrays in, arrays out; only files, importing and pipeline touch disk."""
