"""Damaged manifests, tables and images: what is wrong is told in a sentence, never by a traceback."""

from tests.support.fuzz_import import LEAST_IMPORTED, damaged_imports


def test_damaged_imports_end_in_a_sentence_or_in_a_set() -> None:
    """A sample; ``make fuzz-import`` tries two thousand and calibrates all that can be."""
    ends = list(damaged_imports(60, seed=3, calibrations=1))
    assert [ended for ended in ends if ended.error] == []
    assert sum(ended.imported for ended in ends) >= LEAST_IMPORTED * len(ends)
    assert sum(ended.calibrated for ended in ends) == 1
