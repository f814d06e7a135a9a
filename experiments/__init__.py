"""Experiments: what others have published, done again."""
