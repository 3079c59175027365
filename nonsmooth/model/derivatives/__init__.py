"""Derivatives of fields, events and starts: variational equations and maps of events."""
