"""What trackers sense and hear: target sensor, sonar, radio."""
