"""What a frame shows, read from a batch; nothing is drawn here."""
