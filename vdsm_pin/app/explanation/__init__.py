"""The paper's seven steps at one waypoint: numbers, pictures, one page."""
