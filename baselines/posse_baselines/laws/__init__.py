"""The paper's control laws, for one robot."""
