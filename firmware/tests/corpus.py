"""The inputs that libFuzzer found worth keeping, in one text: each is a line of hexadecimal digits.

corpus.py unpack FOLDER      as files, with the names that libFuzzer gives them
corpus.py pack FOLDER        from files
"""

import hashlib
import sys
from pathlib import Path

CORPUS = Path(__file__).with_suffix(".txt")


def unpack(folder: Path) -> None:
    folder.mkdir(parents=True)
    for line in CORPUS.read_text().split():
        content = bytes.fromhex(line)
        (folder / hashlib.sha1(content, usedforsecurity=False).hexdigest()).write_bytes(content)


def pack(folder: Path) -> None:
    """The same inputs give the same text."""
    inputs = sorted(path.read_bytes() for path in folder.iterdir())
    CORPUS.write_text("".join(f"{content.hex()}\n" for content in inputs))


if __name__ == "__main__":
    word, folder = sys.argv[1:]
    {"unpack": unpack, "pack": pack}[word](Path(folder))
