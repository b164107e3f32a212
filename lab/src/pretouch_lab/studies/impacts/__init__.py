"""Impacts measured by the units' accelerometers: contacts, their judgement, tables."""
