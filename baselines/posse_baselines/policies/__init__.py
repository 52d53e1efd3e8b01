"""Policies that are no setting of the DDCS: simple ones, pursuit, the planners; targets that read nothing."""
