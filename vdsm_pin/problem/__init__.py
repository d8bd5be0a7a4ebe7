"""What is asked: arm, obstacles, desired path, motions, errors."""
