"""The lens: which depth is sharp, how far the glass shifts it, how blurred the rest is."""
