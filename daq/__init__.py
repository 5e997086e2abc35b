"""Data acquisition: cameras, pulses, interlock, run and recorder. Knows neither processing nor server."""
