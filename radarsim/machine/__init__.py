"""The machine that simulations run on: LLVM, threads, compiled kernels."""
