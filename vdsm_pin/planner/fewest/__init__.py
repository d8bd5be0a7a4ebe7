"""Plans in any scene with few bent joints: one graph of sparse shapes."""
