"""The player: a capture and a recipe in, sound out, on one screen."""
