"""The compiled kernels: C++17 behind one binding, ``_native``.

``simd`` is compiled once per instruction set, ``host`` deals its work to threads, ``binding`` is what Python sees.
They know no other module; ``preprocessing``, ``reconstruction``, ``analysis`` and ``synthetic`` are their callers.
"""

DEFAULT_THREADS = 2
"""Of work that runs beside an acquisition or another worker; who has the machine to himself says more."""
