"""Compiled kernels. Private: the functions of the package check and document."""

__version__: str
