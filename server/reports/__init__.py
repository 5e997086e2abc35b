"""Reports as self-contained pages: tables, figures, and what stands in them of a spray.

It may import ``processing``; the demonstration and the commands import it.
"""
