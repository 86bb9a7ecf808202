"""The version of the package, that of the program; a test compares the two."""

__version__ = "1.0.0"
