"""Stage program: SystemTerms -> Program (functions with typed ports, hoisted and counted)."""

from ..base.kernel_table import KERNELS, Kernel, Sizes
from .build_program import ABI, build_program
from .program import Block, KernelDriver, Limits, Port, Program
from .terms import SystemTerms

__all__ = [
    "ABI",
    "KERNELS",
    "Block",
    "Kernel",
    "KernelDriver",
    "Limits",
    "Port",
    "Program",
    "Sizes",
    "SystemTerms",
    "build_program",
]
