"""The film: pixels, noise, frames on disk."""
