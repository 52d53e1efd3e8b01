"""Learning, evaluation, reports and the command line of posse."""
