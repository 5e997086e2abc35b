"""What a disk refuses, in words."""

import errno
from pathlib import Path

import pytest

from daq.errors import DiskForbidden, DiskFull, DiskGone, DiskReadOnly, StorageError
from daq.files.storage import storing

HDF5_TEXT = "Can't decrement id ref count (file write failed: errno = 28, error message = 'No space left on device')"


@pytest.mark.parametrize(
    ("error", "kind", "told"),
    [
        (OSError(errno.ENOSPC, "raw"), DiskFull, "is full"),
        (OSError(errno.EDQUOT, "raw"), DiskFull, "is full"),
        (RuntimeError(HDF5_TEXT), DiskFull, "is full"),
        (OSError(HDF5_TEXT), DiskFull, "is full"),
        (OSError(errno.EROFS, "raw"), DiskReadOnly, "is read-only"),
        (OSError(errno.EACCES, "raw"), DiskForbidden, "may not be written"),
        (OSError(errno.ESTALE, "raw"), DiskGone, "is gone"),
        (OSError(errno.EIO, "raw"), StorageError, "takes no data (input/output error)"),
    ],
)
def test_a_refusal_names_the_folder_and_what_to_do(
    tmp_path: Path, error: Exception, kind: type[StorageError], told: str
) -> None:
    with pytest.raises(StorageError, match=r"then start again$") as refused, storing(tmp_path):
        raise error
    assert type(refused.value) is kind
    assert str(tmp_path) in str(refused.value)
    assert told in str(refused.value)
    assert "errno" not in str(refused.value)


def test_what_is_no_refusal_of_the_disk_stays_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="a bug"), storing(tmp_path):
        raise RuntimeError("a bug")
