"""Set-up of the machine for simulation: LLVM, threads, compiled kernels."""
