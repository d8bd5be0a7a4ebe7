"""Plans a motion; knows no robotics library and does not judge itself."""
