"""HTTP: the application, its guard, REST and pages; the only home of FastAPI and NiceGUI.

It may import everything but the command line; the laboratory knows nothing of it.
"""
