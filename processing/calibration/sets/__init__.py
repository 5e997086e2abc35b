"""What a fit is made from: points of recorded runs, of imported images and of tables.

It reads files, and finds targets in images through ``target``; ``fit`` knows nothing of it.
"""
