"""Analysis at one point: Lie derivatives, regions, sliding fields, intersections of surfaces."""
