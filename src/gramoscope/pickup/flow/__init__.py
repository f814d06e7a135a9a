"""Optical flow: how the texture moved from frame to frame.

Flow (u, v) is in pixels a frame, u along the columns (positive towards larger columns), v along the rows. On frames laid
over each other along the expected motion (`pickup.registration`) it is the *remaining* flow.
"""
