"""From images to measured volumes, read top to bottom: a shot flows from calibration to analysis.

Pure arrays in, arrays out; what touches disk lies in ``runs``, in ``calibration.sets`` and in modules named ``*_file``.
Of ``daq`` it knows the files alone.
"""
