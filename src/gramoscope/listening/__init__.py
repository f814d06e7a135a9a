"""The loudspeaker and the ear: sound files, comparison, pictures."""
