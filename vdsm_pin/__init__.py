"""Planning and proved collision analysis for hyper-redundant manipulators."""

__version__ = "0.1.0"
