"""One run, from the plan to the last shot on the disk: preflight, light, cameras, shots, ending.

It works with ``daq.devices`` and writes through ``daq.files``; it knows neither drivers nor simulation.
"""
