"""What the droplets of a spray say of a calibration: disparity, displaced views, self-calibration.

Pure; it may import ``fit`` and the values of ``processing.calibration``.
"""
