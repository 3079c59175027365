"""Pictures of two-folds: portraits, flow in space, maps of classes, atlas, explorer."""
