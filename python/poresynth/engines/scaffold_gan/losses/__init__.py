"""The losses of ScaffoldGAN, each a function of tensors, in a file of its own.

All are means over elements, so that a weight means the same at any resolution and batch.
"""
