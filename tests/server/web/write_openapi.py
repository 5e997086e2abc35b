"""Print the OpenAPI schema of the application, for the snapshot."""

import json
import sys
import tempfile
from pathlib import Path

from tests.support.serving import serving

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "runs") as server:
        json.dump(server.http.get("/api/openapi.json").json(), sys.stdout, indent=1, sort_keys=True)
        sys.stdout.write("\n")
