"""Architectures of networks, their building blocks, and files of weights."""
