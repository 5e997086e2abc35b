"""From images of a target at known places to the camera of every view, and how far to trust it.

``calibrate`` is the front; ``sets`` is what a fit is made from, ``target`` finds it in images,
``fit`` fits and judges, ``droplets`` corrects.
"""
