"""Warnings about scenarios that can still be run."""
