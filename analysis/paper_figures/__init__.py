"""Shared parts of the scripts that draw the paper's figures beside ours."""
