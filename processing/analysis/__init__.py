"""What a volume says: pure functions on arrays.

It may import everything down to ``reconstruction``; figures, studies and runs import it.
"""
