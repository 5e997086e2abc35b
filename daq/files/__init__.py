"""The data contract: runs on disk. The only door through which ``processing`` sees ``daq``.

``run_directory`` is the front: ``RunReader``, ``RunWriter``, ``list_runs``, ``pack``.
"""
