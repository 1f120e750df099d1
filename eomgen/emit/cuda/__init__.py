"""Stage emit, CUDA: Program -> the text that NVRTC compiles for a device, and the package around it."""
