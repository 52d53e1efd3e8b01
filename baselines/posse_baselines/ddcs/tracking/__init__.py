"""The tracking layer: tasks, leadership, slots, and the motion wanted by each task."""
