"""Data acquisition: cameras, pulses, interlock, run and recorder; knows neither processing nor server.

``run`` works with the protocols of ``devices``; ``drivers`` and ``files`` know values only.
"""
