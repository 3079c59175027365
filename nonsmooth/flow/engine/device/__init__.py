"""The lanes on a GPU: one trajectory per thread, from the same sources as on a CPU."""
