"""One run, from the plan to the last shot on the disk; ``acquisition`` is the front, ``light`` knows whether it is off.

It works with ``daq.devices`` and writes through ``daq.files``; it knows neither drivers nor simulation.
"""
