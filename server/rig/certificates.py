"""A folder of certificates: by them scheduler, workers and those who ask for work know each other, in both directions.

``ca.pem`` signed all of them, ``cert.pem`` and ``key.pem`` are of whoever has the folder.
"""

import ssl
from pathlib import Path

CA, CERTIFICATE, KEY = "ca.pem", "cert.pem", "key.pem"


def require_certificates(folder: Path) -> None:
    """ValueError if they are not there, or cannot be used; the text names the file."""
    for name in (CA, CERTIFICATE, KEY):
        if not (folder / name).is_file():
            raise ValueError(f"there is no file {folder / name}; docs/cluster.md tells how to make it")
    try:
        mutual_context(folder)
    except (ssl.SSLError, OSError) as error:
        raise ValueError(
            f"{folder}: {CA}, {CERTIFICATE} and {KEY} cannot be used ({error}); is the key that of the certificate?"
        ) from error


def mutual_context(folder: Path) -> ssl.SSLContext:
    """For a client that shows its certificate, and asks for one of the same CA; names of hosts do not matter."""
    context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=str(folder / CA))
    context.check_hostname = False
    context.load_cert_chain(folder / CERTIFICATE, folder / KEY)
    return context
