"""Timing and success rates by the public API; never run by the tests."""
