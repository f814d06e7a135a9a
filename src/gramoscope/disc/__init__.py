"""The record: groove geometry, how sound is cut into it, recording characteristics, texture, damage."""
