"""The parts bolted together, and a capture on disk."""
