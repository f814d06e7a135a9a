"""Optical flow: how the texture moved from frame to frame."""
