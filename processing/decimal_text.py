"""Decimal numbers in what a person writes."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
"""Pattern of one: a point stands before decimals, exponents are short."""
