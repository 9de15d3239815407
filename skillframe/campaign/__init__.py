"""Campaigns: many trials over declared uncertainty, stored so that nothing is lost."""
