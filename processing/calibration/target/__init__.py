"""Finding the target in an image: checkerboards and dots, to a fraction of a pixel.

Pure; it knows ``processing.geometry`` only.
"""
