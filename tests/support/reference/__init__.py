"""An independent computation of a world in plain numpy and float64.

Written from the contract and not from the kernels, and in another form wherever there is one:
complex numbers for directions, assignment for slots, graph routines for the radio, Python integers
for the random draws. It reads poses, speeds and faults off the engine's state, one world at a time,
and works out what follows from them.
"""
