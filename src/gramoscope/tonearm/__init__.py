"""The tonearm stays in the groove: joins stretches, bridges damage, smooths the whole passage."""
