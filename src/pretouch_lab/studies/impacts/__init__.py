"""Impacts felt by the units' accelerometers: contacts, their judgement, tables."""
