"""What tests of processing share."""

import pytest

from processing.kernels import _native


@pytest.fixture(params=_native.available_isas())
def isa(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Every instruction set of this machine, one after the other."""
    monkeypatch.setenv("TOMOSHADOW_ISA", request.param)
    return str(request.param)
