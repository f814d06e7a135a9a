"""The instrument run forwards: sound, disc, pictures, and the truth beside them. It knows nothing of the reader."""
