"""Speed and memory of kernels and chain, against plain numpy and OpenCV in the same process.

It may import everything but ``runs`` and ``studies``; the command ``bench`` runs it.
"""
