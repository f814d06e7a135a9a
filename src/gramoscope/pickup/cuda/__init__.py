"""The kernels of the reading for graphics cards that speak CUDA, and the device that calls them; see docs/decisions/0014."""
