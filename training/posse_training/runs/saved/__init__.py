"""What a run keeps on disk: its folder, checkpoints, learning curve and the exported policy."""
