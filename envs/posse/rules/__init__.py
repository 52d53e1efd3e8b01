"""What happens to one world in a control step."""
