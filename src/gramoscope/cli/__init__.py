"""The commands. No signal processing in here."""
