"""What a volume says: pure functions on arrays and tables.

It may import everything down to ``reconstruction``; figures, studies and runs import it.
"""
