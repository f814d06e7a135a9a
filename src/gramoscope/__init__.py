"""Gramoscope plays gramophone records with light: a microscope's film of the groove in, sound with its error bars out."""

from importlib.metadata import version

__version__ = version("gramoscope")
