"""A certified motion near one that is not."""
