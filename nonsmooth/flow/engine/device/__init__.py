"""The lanes on a GPU: one trajectory for each thread, by the same text as on this processor."""
