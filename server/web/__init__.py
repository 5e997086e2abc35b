"""HTTP: the application, its guard, REST and pages; the only home of FastAPI and NiceGUI.

It may import everything but the command line; the laboratory knows nothing of it.
"""

import os

os.environ.setdefault("MATPLOTLIB", "false")
"""For NiceGUI: no page draws by it, and a server that starts would load it for a third of a second of CPU time."""
