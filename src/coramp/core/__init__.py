"""The mathematics of merging: pure functions of numbers and arrays, in SI units.

No file, clock, random number, simulator or plot is used here. Functions are compiled kernels, so
arguments are floats and NumPy arrays; they read what they are given and change only buffers that
are named ``out`` or ``proposal``.
"""
