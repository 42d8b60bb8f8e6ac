"""What the parts share: errors, units, the specimen, the magnet, the centreline.

Nothing here imports more than numpy, and the command line imports only the modules
of this package that do without it (`errors`, `units`, `specimen`, `magnet`).
"""
