"""The phono preamp: place to time, and the recording characteristic undone."""
